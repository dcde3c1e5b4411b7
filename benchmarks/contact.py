"""What the contact's settings do to friction: cone, impedance and stiffness, measured.

One sled on the scene's ramp in MuJoCo's C engine. For each setting: the error of the sliding
acceleration as an error of the friction coefficient, the largest hop off the surface, how far
an object creeps in 2 s that friction should hold, and the least change of friction that the
distance slid follows smoothly. Used by docs/explanation/contact.md.

    python -m benchmarks.contact
"""

# mujoco's classes live in a compiled module without stubs.
# pyright: reportAttributeAccessIssue=false

import json
import math
from dataclasses import dataclass

import mujoco
import numpy as np

from galileo_jax.files.package_data import scene_path

ANGLE_DEG = 20.0
GRAVITY = 9.81
FRICTION = (0.05, 0.1, 0.2, 0.3)
HELD = 0.5  # tan(20 degrees) is 0.36
SETTLE_S, SLIDE_S, CREEP_S = 0.1, 0.3, 2.0
SLOPE_STEP = 1e-4  # of friction, in the derivative that is compared


@dataclass(frozen=True)
class Setting:
    """One way to model the contact."""

    name: str
    cone: str
    solref: tuple[float, float]
    solimp: tuple[float, float, float]


SETTINGS = (
    Setting("MuJoCo's defaults", "pyramidal", (0.02, 1.0), (0.9, 0.95, 0.001)),
    Setting("elliptic, constant impedance", "elliptic", (0.02, 1.0), (0.9, 0.9, 0.001)),
    Setting("pyramidal, from 0", "pyramidal", (-100.0, -600.0), (0.0, 0.999, 0.0015)),
    Setting("elliptic, from 0 (ours)", "elliptic", (-100.0, -600.0), (0.0, 0.999, 0.0015)),
)


def compile_setting(setting: Setting) -> mujoco.MjModel:
    """The scene with object 1 alone on the ramp."""
    spec = mujoco.MjSpec.from_file(str(scene_path("ramp.xml")))
    for pair in list(spec.pairs):
        if pair.name != "object1_ramp":
            spec.delete(pair)
    spec.delete(spec.body("object2"))
    spec.option.cone = getattr(mujoco.mjtCone, f"mjCONE_{setting.cone.upper()}")
    pair = spec.pairs[0]
    pair.solref = setting.solref
    pair.solimp = [*setting.solimp, 0.5, 2]
    return spec.compile()


def slide(model: mujoco.MjModel, friction: float, seconds: float) -> np.ndarray:
    """Distances along and off the ramp and the speed along it, `[3, step]`."""
    model.pair_friction[:, :2] = friction
    data = mujoco.MjData(model)
    angle = math.radians(ANGLE_DEG)
    along, off = (math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle))
    found = []
    for _ in range(round(seconds / model.opt.timestep)):
        found.append((data.qpos @ along, data.qpos @ off, data.qvel @ along))
        mujoco.mj_step(model, data)
    return np.array(found).T


def measure(setting: Setting) -> dict[str, float | str]:
    """All figures of one setting."""
    model = compile_setting(setting)
    angle = math.radians(ANGLE_DEG)
    first, last = (round(t / model.opt.timestep) for t in (SETTLE_S, SLIDE_S - 0.01))
    errors, hops, slopes = [], [], []
    for friction in FRICTION:
        _, off, speed = slide(model, friction, SLIDE_S)
        acceleration = (speed[last] - speed[first]) / ((last - first) * model.opt.timestep)
        implied = math.tan(angle) - acceleration / (GRAVITY * math.cos(angle))
        errors.append(implied - friction)
        hops.append(np.ptp(off[first:]))
        high, low = (slide(model, friction + s * SLOPE_STEP, SLIDE_S)[0, -1] for s in (1, -1))
        exact = -0.5 * GRAVITY * math.cos(angle) * SLIDE_S**2
        slopes.append((high - low) / (2 * SLOPE_STEP) / exact)
    creep = slide(model, HELD, CREEP_S)[0]
    held = round(SETTLE_S / model.opt.timestep)
    return {
        "setting": setting.name,
        "friction_error": float(np.abs(errors).max()),
        "hop_mm": 1e3 * float(max(hops)),
        "creep_mm_in_2_s": 1e3 * float(creep[-1] - creep[held]),
        "slope_low": float(min(slopes)),
        "slope_high": float(max(slopes)),
    }


def main() -> None:
    """Prints the table and a JSON line."""
    rows = [measure(setting) for setting in SETTINGS]
    print(f"{'':<30}{'friction off by':>16}{'hop, mm':>10}{'creep, mm':>11}{'slope / exact':>18}")
    for row in rows:
        slope = f"{row['slope_low']:.3f} .. {row['slope_high']:.3f}"
        print(
            f"{row['setting']:<30}{row['friction_error']:>16.5f}{row['hop_mm']:>10.4f}"
            f"{row['creep_mm_in_2_s']:>11.3f}{slope:>18}"
        )
    print(json.dumps({"benchmark": "contact", "mujoco": mujoco.__version__, "rows": rows}))


if __name__ == "__main__":
    main()

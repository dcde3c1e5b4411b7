"""Are the spins of flying balls found, and are their intervals right? Flights whose truth is known.

    python benchmarks/spins.py --num 40 --seed 0

Table-tennis balls in space, as in the measured flights of docs/explanation/real_data.md: 5 to 9
m/s, 0.25 to 0.5 s, irregular times that are half a millisecond off, places a millimetre off. SciPy
moves them, by weight, drag (C_d 0.4 to 0.6) and Stepanek's lift (0.8 to 1.3 times). Of each four,
one has no spin, one has none but a scale or a clock that is 1 to 4 % off, and two have a spin of
100 to 400 rad/s in any direction, which nobody tells. `fit` gives intervals of the spins;
`diagnose`, with --diagnose, says what is missing. The last line is JSON.
"""

import argparse
import math
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tables
from scipy.integrate import solve_ivp
from verdicts import LARGEST_SET

import galileo_jax as gx
from galileo_jax.commands import command
from galileo_jax.model.effects.air import AIR_KG_M3

MASS_KG, RADIUS_M, GRAVITY = 0.0027, 0.02, 9.81
SPEED_M_S, LASTS_S, EVERY_S = (5.0, 9.0), (0.25, 0.5), (0.005, 0.01)
PLACE_SD_M, TIME_SD_S = 1e-3, 5e-4
DRAG, LIFT, SPIN_RAD_S, WRONG = (0.4, 0.6), (0.8, 1.3), (100.0, 400.0), (0.01, 0.04)
KINDS = ("none", "spin", "error", "spin")
YAML = f"""track: flight.csv
track_up: z
scenario: flight
objects:
  - {{name: object1, shape: sphere, size_m: [{RADIUS_M}], mass_kg: {MASS_KG}}}
"""


class Flight(NamedTuple):
    """One ball.

    Attributes:
      kind: of `KINDS`.
      spin_rad_s: `[3]`; x, y (up), z.
      error: "scale_error", "frame_rate" or "".
      yaml: where it was written.
    """

    kind: str
    spin_rad_s: np.ndarray
    error: str
    yaml: Path


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    z, inside, said = [], [], Counter[str]()
    tables.row("flight", ("kind", "spin", "z x", "z y", "z z", "says"))
    with tempfile.TemporaryDirectory() as folder:
        for i in range(call.num):
            kind = KINDS[i % len(KINDS)]
            flight = draw(Path(folder), kind, np.random.default_rng([call.seed, i]))
            row: list[Any] = [None, None, None]
            if kind == "spin":
                effects = ["air_drag", "magnus"]
                found = gx.fit(flight.yaml, effects=effects, method=call.method, seed=0)
                for axis, true in enumerate(flight.spin_rad_s):
                    told = found.result["parameters"][f"magnus_{'xyz'[axis]}"]
                    row[axis] = (told["mean"] - true) / told["sd"]
                    inside.append(told["q025"] <= true <= told["q975"])
                z += row
            words = ""
            if call.diagnose:
                verdict = gx.diagnose(flight.yaml, seed=0).verdict
                words = f"  {verdict.status} {', '.join(verdict.effects)}"
                said[f"{kind}: {outcome(verdict.status, verdict.effects)}"] += 1
            size = float(np.linalg.norm(flight.spin_rad_s))
            tables.row(f"{i} {flight.error}", (kind, size, *row, words))
    figures = {
        "method": call.method,
        "seed": call.seed,
        "rms_z": float(np.sqrt(np.mean(np.square(z)))),
        "inside": f"{sum(inside)} of {len(inside)}",
        "said": dict(sorted(said.items())),
    }
    for name, value in figures.items():
        print(f"{name}: {value}")
    tables.finish("spins", figures)
    return None


def outcome(status: str, effects: Sequence[str]) -> str:
    """What a verdict says of the spin, in a few words."""
    has_spin = [name for name in effects if "magnus" in name]
    if status == "named":
        return "spin named" if has_spin else "named without"
    if status == "ambiguous" and has_spin:
        return "spin among three" if len(effects) <= LARGEST_SET else "spin among more"
    return "ambiguous without" if status == "ambiguous" else status


def draw(folder: Path, kind: str, rng: np.random.Generator) -> Flight:
    """A flight, its track and its yaml."""
    speed, elevation = rng.uniform(*SPEED_M_S), rng.uniform(-0.1, 0.5)
    azimuth = rng.uniform(0, 2 * math.pi)
    level = speed * math.cos(elevation)
    velocity = [level * math.cos(azimuth), speed * math.sin(elevation), level * math.sin(azimuth)]
    times = np.cumsum(rng.uniform(*EVERY_S, 200))
    times = times[times < rng.uniform(*LASTS_S)]
    times -= times[0]
    spin = np.zeros(3)
    if kind == "spin":
        direction = rng.standard_normal(3)
        spin = rng.uniform(*SPIN_RAD_S) * direction / np.linalg.norm(direction)
    path = flown(np.array(velocity), spin, times, rng.uniform(*DRAG), rng.uniform(*LIFT))
    error = str(rng.choice(["scale_error", "frame_rate"])) if kind == "error" else ""
    off = 1 + float(rng.choice([-1, 1]) * rng.uniform(*WRONG))
    path *= off if error == "scale_error" else 1.0
    told = times * (off if error == "frame_rate" else 1.0)
    path += PLACE_SD_M * rng.standard_normal(path.shape)
    told += np.append(0.0, TIME_SD_S * rng.standard_normal(len(told) - 1))
    table = np.stack([told, path[0], -path[2], path[1]], axis=1)  # the file has z up
    np.savetxt(folder / "flight.csv", table, "%.6f", ",", header="time_s,x_m,y_m,z_m", comments="")
    yaml = folder / "flight.yaml"
    yaml.write_text(YAML)
    return Flight(kind, spin, error, yaml)


def flown(
    velocity: np.ndarray, spin: np.ndarray, times: np.ndarray, drag: float, lift: float
) -> np.ndarray:
    """Places `[3, row]`, m, y up."""
    size = lift * AIR_KG_M3 * math.pi * RADIUS_M**3 / 2
    resistance = drag * AIR_KG_M3 * math.pi * RADIUS_M**2 / 2

    def change(_: float, state: np.ndarray) -> np.ndarray:
        v = state[3:]
        fast, turned = np.linalg.norm(v), np.cross(spin, v)
        curve = size * turned / (1 + 2 * RADIUS_M * np.linalg.norm(turned) / fast**2)
        force = curve - resistance * fast * v
        return np.concatenate([v, force / MASS_KG - [0.0, GRAVITY, 0.0]])

    begin = np.concatenate([[0.0, 1.0, 0.0], velocity])
    return solve_ivp(change, (0.0, times[-1]), begin, t_eval=times, rtol=1e-9).y[:3]


def _parser() -> command.Parser:
    parser = command.Parser(prog="spins.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=command.whole_number(1), default=40, help="flights")
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    parser.add_argument("--method", choices=("grad", "mh"), default="grad")
    parser.add_argument("--diagnose", action="store_true", help="takes minutes")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

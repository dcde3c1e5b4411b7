"""How well is a thrown cube predicted, by this program and by MuJoCo as it suits it best?

    python -m benchmarks cube_peers ../shared/data/real/cube_tosses

Every third toss is for learning: this program's joint fit (`galileo.fit_tosses`), and for MuJoCo
the friction, the time constant and the damping of its contacts that predict these tosses best: of
scattered ones the best, and Nelder-Mead from there. Then each predicts the tosses that none has
learned from, from the same start: place, turning, velocity and spin at the last frame before the
first impact, as the flight tells them. Both have the edge, the inertia, the centre of mass, the
floor and the gravity of this program's fit; its cube alone has rounded corners. "Even mass": the
same without its centre of mass and its inertia, as anybody would simulate a cube.

Errors are means over the frames from the first impact on, of the place over the edge and of the
turning, and medians over the tosses.
"""
# pyright: reportAttributeAccessIssue=false

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from benchmarks import tables
from benchmarks.real_sets import joint_fit
from galileo_jax.clip.poses_csv import read_poses_csv
from galileo_jax.inference.toss.residuals import CENTRE, COMMON, Start, forward, motion
from galileo_jax.measurement.toss_flight import flight_of
from galileo_jax.runtime.precision import in_float64

STEP_S = 5e-4
EDGE_M, MASS_KG = 0.1048, 0.37  # as published
SAME_ERROR_RAD = 0.5  # a turning that counts as much as a whole edge
NUM_SCATTERED, SCATTERED_LOG, MOST_EVALUATIONS = 100, 1.5, 100
LONGEST = 256  # frames: all tosses share one program
SOLID = 1 / 6  # inertia of an even cube, in its mass times edge squared
FIRST_TRIED = (0.2, 0.01, 0.5)  # MuJoCo's: friction, time constant and damping of a contact


class Thrown(NamedTuple):
    """One toss from its last frame in free flight on.

    Attributes:
      name: of its file.
      start: what the flight tells of that frame.
      times_s: `[frame]`, from that frame's on.
      position_m, quaternion: `[frame, 3]`, `[frame, 4]`, as measured.
    """

    name: str
    start: Start
    times_s: np.ndarray
    position_m: np.ndarray
    quaternion: np.ndarray


class Cube(NamedTuple):
    """What all simulators are given.

    Attributes:
      edge: m.
      gravity: m/s^2.
      floor: its height, m.
      inertia: principal moment over mass times edge squared.
      centre: `[3]`, of mass, from the middle of the cube along its own axes, m.
    """

    edge: float
    gravity: float
    floor: float
    inertia: float
    centre: np.ndarray

    @property
    def moment_kg_m2(self) -> float:
        """About any axis through the centre of mass."""
        return self.inertia * MASS_KG * self.edge**2


Simulator = Callable[[Thrown, Cube, np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Toss, cube and parameters to places `[frame, 3]` and quaternions `[frame, 4]`."""


@in_float64
def main(folder: Path, *, every: int = 3) -> dict[str, Any]:
    paths = sorted(folder.glob("*.csv"))
    thrown = [one for path in paths if (one := at_the_impact(path)) is not None]
    learned = {path.stem for path in paths[::every]}
    common = joint_fit(paths[::every]).solution.solution.common
    value = dict(zip(COMMON, np.asarray(forward(jnp.asarray(common))).tolist(), strict=True))
    cube = Cube(
        edge=value["edge"],
        gravity=value["gravity"],
        floor=value["floor"],
        inertia=value["inertia"],
        centre=np.array([value[name] for name in CENTRE]),
    )
    old = [one for one in thrown if one.name in learned]
    new = [one for one in thrown if one.name not in learned]
    middle = cube._replace(inertia=SOLID, centre=np.zeros(3))
    figures: dict[str, Any] = {"learned": len(old), "predicted": len(new)}
    tables.row("simulator", ("place/edge", "turning deg", "learned from: place", "turning"))

    def show(name: str, simulator: Simulator, cube: Cube, parameters: np.ndarray) -> None:
        errors = [
            np.median([error_of(one, simulator(one, cube, parameters), cube) for one in group], 0)
            for group in (new, old)
        ]
        flat = [float(x) for place, turn in errors for x in (place, np.degrees(turn))]
        figures[name] = {"errors": flat, "parameters": np.asarray(parameters).tolist()}
        tables.row(name, flat)

    show("galileo_jax", by_galileo, cube, common)
    for name, given in (("mujoco", cube), ("mujoco, even mass", middle)):
        show(name, by_mujoco, given, best_for(by_mujoco, old, given, np.array(FIRST_TRIED)))
    return figures


def at_the_impact(path: Path) -> Thrown | None:
    """A toss from its last free frame on; None where it does not fly for long enough."""
    poses = read_poses_csv(path, "z", EDGE_M)
    flight = flight_of(poses, np.full(3, EDGE_M))
    if flight is None or flight.last >= len(poses.times_s) - 2:
        return None
    flown_s = poses.times_s[flight.last] - poses.times_s[0]
    turned = Rotation.from_rotvec(flight.spin_rad_s * flown_s) * Rotation.from_quat(
        flight.quaternion, scalar_first=True
    )
    velocity = flight.velocity_m_s + flight.acceleration_m_s2 * flown_s
    place = flight.position_m + (flight.velocity_m_s + velocity) / 2 * flown_s
    begin = (place, turned.as_quat(scalar_first=True), velocity, flight.spin_rad_s)
    start = Start(*(jnp.asarray(each) for each in begin))
    rest = slice(flight.last, None)
    return Thrown(
        path.stem,
        start,
        poses.times_s[rest] - poses.times_s[flight.last],
        poses.position_m[rest],
        poses.quaternion[rest],
    )


def best_for(
    simulator: Simulator, tosses: Sequence[Thrown], cube: Cube, begin: np.ndarray
) -> np.ndarray:
    """The parameters, all positive, with the least median error."""

    def worse(logs: np.ndarray) -> float:
        predicted = [simulator(one, cube, np.exp(logs)) for one in tosses]
        errors = np.array([error_of(*pair, cube) for pair in zip(tosses, predicted, strict=True)])
        return float(np.median(errors[:, 0]) + np.median(errors[:, 1]) / SAME_ERROR_RAD)

    generator = np.random.default_rng(0)
    far = generator.uniform(-SCATTERED_LOG, SCATTERED_LOG, (NUM_SCATTERED, len(begin)))
    first = min(np.log(begin) + far, key=worse)
    simplex = first + np.concatenate([np.zeros((1, len(begin))), 0.3 * np.eye(len(begin))])
    options = {"maxfev": MOST_EVALUATIONS, "initial_simplex": simplex}
    return np.exp(minimize(worse, first, method="Nelder-Mead", options=options).x)


def error_of(
    one: Thrown, predicted: tuple[np.ndarray, np.ndarray], cube: Cube
) -> tuple[float, float]:
    """Of the place over the edge, and of the turning, rad: means over the frames."""
    place, quaternion = (values[1:] for values in predicted)
    turned = Rotation.from_quat(quaternion, scalar_first=True)
    seen = Rotation.from_quat(one.quaternion[1:], scalar_first=True)
    far = np.linalg.norm(place - one.position_m[1:], axis=1).mean() / cube.edge
    return float(far), float((seen * turned.inv()).magnitude().mean())


def by_galileo(one: Thrown, cube: Cube, common: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """This program's free body; `common` in the space of its search."""
    steps = np.diff(one.times_s)
    padded = np.pad(steps, (0, LONGEST - len(steps)), constant_values=steps[-1])
    poses = _motion(jnp.asarray(common), jnp.zeros(12), one.start, jnp.asarray(padded))
    frames = slice(len(one.times_s))
    return np.asarray(poses.position_m)[frames], np.asarray(poses.quaternion)[frames]


def by_mujoco(one: Thrown, cube: Cube, parameters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """MuJoCo; parameters: friction, time constant of a contact, s, and its damping ratio."""
    friction, constant, damping = parameters
    (x, y, z), half, moment = cube.centre, cube.edge / 2, cube.moment_kg_m2
    model = mujoco.MjModel.from_xml_string(f"""
      <mujoco><option timestep="{STEP_S}" gravity="0 0 {-cube.gravity}" cone="elliptic"
                      impratio="10"/>
        <default><geom friction="{friction} 0 0" condim="3"
                       solref="{max(constant, 2 * STEP_S)} {damping}"/></default>
        <worldbody><geom type="plane" size="5 5 1" pos="0 0 {cube.floor}"/>
          <body><freejoint/>
            <inertial pos="{x} {y} {z}" mass="{MASS_KG}" diaginertia="{moment} {moment} {moment}"/>
            <geom type="box" size="{half} {half} {half}"/></body>
        </worldbody></mujoco>""")
    data = mujoco.MjData(model)
    data.qpos = np.concatenate([one.start.position_m, one.start.quaternion])
    # MuJoCo has spins along the body's own axes.
    turned = Rotation.from_quat(np.asarray(one.start.quaternion), scalar_first=True)
    spin = turned.inv().apply(np.array(one.start.spin_rad_s))
    data.qvel = np.concatenate([one.start.velocity_m_s, spin])
    found = [data.qpos.copy()]
    for count in np.diff(np.rint(one.times_s / STEP_S).astype(int)):
        mujoco.mj_step(model, data, int(count))
        found.append(data.qpos.copy())
    poses = np.array(found)
    return poses[:, :3], poses[:, 3:]


_motion = jax.jit(motion)

"""Pucks on a table seen from above, with known truth.

The laws are the effects'; the motion is stepped finely (`STEP_S`, of second order), hits are met
within a step, so that a clip is no copy of the engine that fits it.
"""

import math
from collections.abc import Mapping

import numpy as np

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.laws.pucks import OFFSET, START
from galileo_jax.model.effects.laws.walls import ENDS as WALL_ENDS
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at
from galileo_jax.simulation.hidden import with_given
from galileo_jax.simulation.level_hits import Rails, Rims, Table
from galileo_jax.simulation.motion import Motion
from galileo_jax.simulation.plane import PlaneTruth
from galileo_jax.simulation.truth import GRAVITY_M_S2

STEP_S, STEPS_PER_RECORD = 1e-4, 2
LONGEST_S = 4.0
REST_S = 0.2  # looked at so long after everything has come to rest
MOST_EVENTS = 20  # within one step
ROOM_M = (0.01, 0.06)  # between a puck's start and the wall behind it
SCENARIO = "from_above"


def draw_level(
    rng: np.random.Generator, given: Mapping[str, float], has_walls: bool = False
) -> PlaneTruth:
    """Draws two pucks, the first on its way to the second, with what `given` leaves open.

    Where there are walls, four of them stand round the pucks, nearer than these can go.

    Raises:
      InputError: a given name is no parameter of the scenario.
    """
    radii = np.round(rng.uniform(0.015, 0.03, 2), 3)
    masses = np.exp(rng.uniform(math.log(0.02), math.log(0.08), 2))
    frictions = rng.uniform(0.08, 0.3, 2)
    away, heading = rng.uniform(0.2, 0.4), rng.uniform(-0.5, 0.5)
    # Past the middle by so much of the reach: from head-on to a glancing hit.
    aside = rng.uniform(-0.7, 0.7) * radii.sum()
    speed = math.sqrt(2 * frictions[0] * GRAVITY_M_S2 * away) * rng.uniform(1.4, 2.2)
    values = {
        "m1": masses[0],
        "k1": frictions[0],
        "m2": masses[1],
        "k2": frictions[1],
        "start_velocity_x1": speed * math.cos(heading),
        "start_velocity_y1": speed * math.sin(heading),
        "start_turning1": rng.uniform(-15.0, 15.0),
        "restitution": rng.uniform(0.4, 0.95),
        "grip": rng.uniform(0.05, 0.35),
    }
    if has_walls:  # drawn last: the same pucks as without walls
        values |= {
            "wall_restitution": rng.uniform(0.4, 0.95),
            "wall_grip": rng.uniform(0.05, 0.35),
        }
    values = with_given(SCENARIO, values, given)
    values |= {f"{OFFSET}_{axis}2": 0.0 for axis in "xy"}
    x, y = (
        away * math.cos(heading) - aside * math.sin(heading),
        away * math.sin(heading) + aside * math.cos(heading),
    )
    things = tuple(
        ClipObject(name=f"object{i + 1}", shape="cylinder", size_m=(float(r), 0.01))
        for i, r in enumerate(radii)
    )
    start = ((0.0, 0.0), (round(x, 4), round(y, 4)))
    if not has_walls:
        return PlaneTruth(SCENARIO, things, values, start)
    room = radii.max() + rng.uniform(*ROOM_M, 4)
    low, high = np.min(start, axis=0) - room[:2], np.max(start, axis=0) + room[2:]
    corners = [(low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1])]
    corners = [(round(float(x), 4), round(float(y), 4)) for x, y in corners]
    walls = tuple(zip(corners, corners[1:] + corners[:1], strict=True))
    values |= {f"wall_offset_{end}{i + 1}": 0.0 for i in range(len(walls)) for end in WALL_ENDS}
    return PlaneTruth(SCENARIO, things, values, start, walls_m=walls)


def solve_level(truth: PlaneTruth) -> tuple[Motion, tuple[float, ...]]:
    """The motion, the turning as `pitch_rad`, and when pucks hit each other, s."""
    scene = truth.surroundings
    theta, effects = truth.theta, truth.laws
    law = dynamics(effects, scene, theta, np)
    radii = np.array(scene.half_length_m)
    count = len(radii)
    place, speed = np.zeros((count, 3)), np.zeros((count, 3))
    place[:, :2] = truth.start_m
    speed[0] = [truth.values[f"{name}1"] for name in START]
    speed[:, 2] *= radii / math.sqrt(2)
    beside, oval = np.zeros((count, 2)), None
    for effect in effects:
        if (pressure := effect.pressure(theta, scene)) is not None:
            beside = np.stack([-pressure[:, 1], pressure[:, 0]], axis=1)
        oval = effect.oval(theta, scene) if oval is None else oval
    rims = Rims(radii, np.zeros((count, 2)) if oval is None else np.asarray(oval))
    table = Table(rims, Rails.of(truth.walls_m), law.mass, truth.values)
    way, hits, rows = np.zeros(count), [], []
    last = round(LONGEST_S / STEP_S)
    for index in range(last + 1):
        if index % STEPS_PER_RECORD == 0:
            rows.append((place.copy(), speed.copy()))
        if not speed.any():
            last = min(last, index + round(REST_S / STEP_S))
        if index == last:
            break
        left = STEP_S
        for _ in range(MOST_EVENTS):
            turned = math.sqrt(2) * place[:, 2] / radii
            lever = math.sqrt(2) * (_turner(turned) @ beside[..., None])[..., 0]
            ended = _rubbed(speed, way, lever, index * STEP_S, left, law, scene)
            mean = (speed + ended) / 2
            spent, struck = table.next_hit(place, mean, left)
            place, way = place + spent * mean, way + spent * np.hypot(*mean[:, :2].T)
            speed = ended if struck is None else speed + (ended - speed) * (spent / left)
            left -= spent
            if struck is None:
                break
            i, other, is_wall = struck
            if is_wall:
                table.strike_wall(place, speed, i, other)
            else:
                table.strike(place, speed, i, other)
                hits.append((index + 1) * STEP_S - left)
    places, speeds = (np.moveaxis(np.array(each), 0, -1) for each in zip(*rows, strict=True))
    times = STEP_S * STEPS_PER_RECORD * np.arange(len(rows))
    turned = places[:, 2] * math.sqrt(2) / radii[:, None]
    return Motion(times, places[:, :2], speeds[:, :2], turned), tuple(hits)


def _rubbed(
    speed: np.ndarray,
    way: np.ndarray,
    lever: np.ndarray,
    time_s: float,
    spent_s: float,
    law: Dynamics,
    scene: Surroundings,
) -> np.ndarray:
    """Speeds after a time's forces; friction ends a motion, and does not turn it round."""
    along, size = np.hypot(*speed[:, :2].T), np.linalg.norm(_slip(speed, lever), axis=1)
    drive = law.drive(state_at(way, along, np.asarray(time_s), scene)) / law.inertia
    brake = law.brake(state_at(way, size, np.asarray(time_s), scene)) / law.inertia
    pushed = speed.copy()
    pushed[:, :2] += (
        spent_s * drive[:, None] * speed[:, :2] / np.where(along > 0, along, 1.0)[:, None]
    )
    pushed[:, 0] += spent_s * law.gravity * np.sin(law.ramp_rad)
    pushed[:, 1] += spent_s * law.gravity * np.sin(law.table_rad)
    lost = (spent_s * brake)[:, None]
    half_way = pushed - 0.5 * lost * _against(pushed, lever)
    against = _against(half_way, lever)
    size = np.linalg.norm(pushed, axis=1)
    stops = (lost[:, 0] * (against * pushed).sum(axis=1) >= size**2) | (lost[:, 0] >= 2 * size)
    return np.where(stops[:, None], 0.0, pushed - lost * against)


def _slip(speed: np.ndarray, lever: np.ndarray) -> np.ndarray:
    """Of the centre of the pressure, `[object, 3]`."""
    return np.concatenate([speed[:, :2] + speed[:, 2:] * lever, speed[:, 2:]], axis=1)


def _against(speed: np.ndarray, lever: np.ndarray) -> np.ndarray:
    """Friction's direction, reversed, on the speeds of the middle, `[object, 3]`."""
    slip = _slip(speed, lever)
    size = np.linalg.norm(slip, axis=1, keepdims=True)
    slip = slip / np.where(size > 0, size, 1.0)
    return np.concatenate(
        [slip[:, :2], slip[:, 2:] + (lever * slip[:, :2]).sum(axis=1, keepdims=True)], axis=1
    )


def _turner(turned: np.ndarray) -> np.ndarray:
    """Of every disc the matrix that turns counter-clockwise, `[object, 2, 2]`."""
    cos, sin = np.cos(turned), np.sin(turned)
    return np.stack([np.stack([cos, -sin], axis=-1), np.stack([sin, cos], axis=-1)], axis=-2)

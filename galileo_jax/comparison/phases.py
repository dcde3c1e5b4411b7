"""Divides a motion into phases (on the ramp, at the foot, after the hit, ...).

In which phase a model fails is a strong hint at what it lacks.
"""

from dataclasses import dataclass
from itertools import combinations, pairwise, product

import numpy as np

from galileo_jax.inference.problem import Problem, since_release
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.numerics.line_segments import distance_to_segment

ON_A_SURFACE = ("held", "ramp", "foot", "table", "collision", "after", "at rest")
PHASES = (*ON_A_SURFACE, "fall", "flight", "swing", "liquid")
FREE = {"spring": "swing", "pendulum": "swing", "liquid": "liquid"}  # by the law that makes it
COLLISION_S = 0.05  # either side of the hit
RESTS_M_S, TOUCHES_M = 2e-3, 1e-4


@dataclass(frozen=True)
class Phase:
    """A time during which an object moves in one way: one of `PHASES`, on the clip's clock."""

    name: str
    start_s: float
    end_s: float


def phases_of(labels: np.ndarray, times_s: np.ndarray) -> tuple[Phase, ...]:
    """The phases of one object, one after the other.

    `labels` `[frame]` are indices into `PHASES`.
    """
    borders = [0, *map(int, np.flatnonzero(np.diff(labels)) + 1), len(labels) - 1]
    return tuple(
        Phase(PHASES[labels[start]], float(times_s[start]), float(times_s[end]))
        for start, end in pairwise(borders)
        if end > start
    )


def phases(problem: Problem, theta: np.ndarray) -> np.ndarray:
    """The phase of every object in every frame, from the fitted motion.

    `[object, frame]`, indices into `PHASES`. held: before the release; ramp, foot (its length spans
    the foot), table; collision: near the first hit; after it; at rest: where nothing moves any
    more, or not yet; fall, flight, swing, liquid: without anything to slide on.
    """
    model = problem.model
    scene = model.scene.surroundings
    times = since_release(model, theta, problem.observation.times_s)
    position, velocity = (a[0] for a in problem.engine.simulate(theta[None]))
    recorded = np.arange(position.shape[-1]) * model.record_dt_s
    label = np.empty((len(scene.names), len(times)), int)
    hit_s = _hit_s(position, recorded, scene)
    for i in range(len(scene.names)):
        x = np.interp(times, recorded, position[i, 0])
        speed = np.interp(times, recorded, np.linalg.norm(velocity[i], axis=0))
        label[i] = PHASES.index("table")
        if scene.comes_down[i] or not scene.has_table:
            beyond = x - scene.corner_m[i]  # -inf without a table
            half = scene.half_length_m[i]
            label[i][beyond < half] = PHASES.index("foot")
            label[i][beyond < -half] = PHASES.index("ramp")
        if not scene.has_surface:
            label[i] = PHASES.index(free_phase(scene))
        if scene.is_level:
            label[i] = PHASES.index("table")
        label[i][speed < RESTS_M_S] = PHASES.index("at rest")
        label[i][times > hit_s[i]] = PHASES.index("after")
        label[i][np.abs(times - hit_s[i]) <= COLLISION_S] = PHASES.index("collision")
        label[i][times < 0 if scene.starts_moving else times <= 0] = PHASES.index("held")
    return label


def free_phase(scene: Surroundings) -> str:
    """What the motion of an object that slides on nothing is called."""
    usual = "flight" if scene.moves_in_plane else "fall"
    return next((phase for law, phase in FREE.items() if law in scene.laws), usual)


def _hit_s(position: np.ndarray, times_s: np.ndarray, scene: Surroundings) -> list[float]:
    """When each object first touches another, or a wall; infinite where it does not."""
    found, half_m = [np.inf] * len(position), scene.half_length_m

    def note(gap_m: np.ndarray, *who: int) -> None:
        touching = np.flatnonzero(gap_m < TOUCHES_M)
        for i in who if touching.size else ():
            found[i] = min(found[i], float(times_s[touching[0]]))

    if not scene.is_level:
        for i, j in pairwise(range(len(position))):
            note(position[j, 0] - position[i, 0] - half_m[i] - half_m[j], i, j)
        return found

    def nearest(apart_m: np.ndarray) -> np.ndarray:
        """Between two records they come nearer than in either."""
        return apart_m - np.abs(np.diff(apart_m, append=apart_m[-1:]))

    for i, j in combinations(range(len(position)), 2):
        apart = np.linalg.norm(position[j, :2] - position[i, :2], axis=0)
        note(nearest(apart) - half_m[i] - half_m[j], i, j)
    for i, ends in product(range(len(position)), scene.walls_m):
        away = distance_to_segment(np.moveaxis(position[i, :2], 0, -1), ends)
        note(nearest(away) - half_m[i], i)
    return found

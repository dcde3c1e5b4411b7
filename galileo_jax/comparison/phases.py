"""Divides a motion into phases (on the ramp, at the foot, after the hit, ...).

In which phase a model fails is a strong hint at what it lacks.
"""

from dataclasses import dataclass
from itertools import combinations, pairwise, product

import numpy as np

from galileo_jax.clip.walls import distance_to_wall
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.effect import Surroundings

PHASES = ("held", "ramp", "foot", "table", "collision", "after", "at rest", "fall")
FREE = {"spring": "swing", "pendulum": "swing", "liquid": "liquid"}  # by the law that makes it
PHASES += ("flight", "swing", "liquid")
COLLISION_S = 0.05  # either side of the hit
RESTS_M_S = 2e-3


@dataclass(frozen=True)
class Phase:
    """A time during which an object moves in one way: one of `PHASES`, on the clip's clock."""

    name: str
    start_s: float
    end_s: float


def phases_of(labels: np.ndarray, times_s: np.ndarray) -> tuple[Phase, ...]:
    """The phases of one object, one after the other.

    Args:
      labels: `[frame]`, indices into `PHASES`.
      times_s: `[frame]`.
    """
    borders = [0, *map(int, np.flatnonzero(np.diff(labels)) + 1), len(labels) - 1]
    return tuple(
        Phase(PHASES[labels[start]], float(times_s[start]), float(times_s[end]))
        for start, end in pairwise(borders)
        if end > start
    )


def phases(problem: Problem, theta: np.ndarray) -> np.ndarray:
    """The phase of every object in every frame, from the fitted motion.

    held: before the release; ramp, foot (its length spans the foot), table; collision: near
    the first hit; after it; at rest: where nothing moves any more, or not yet; fall, flight,
    swing, liquid: without anything to slide on.

    Args:
      problem: the clip and its model.
      theta: `[model parameter]`, in their units.

    Returns:
      `[object, frame]`, indices into `PHASES`.
    """
    model = problem.model
    scene = model.scene.surroundings
    named = model.by_name(theta)
    times = np.asarray(problem.observation.times_s)
    for effect in model.effects + model.nuisances:
        times = np.asarray(effect.time(times, named, scene))
    position, velocity = (a[0] for a in problem.engine.simulate(theta[None]))
    recorded = np.arange(position.shape[-1]) * model.record_dt_s
    label = np.empty((len(scene.names), len(times)), int)
    if scene.is_level:
        hit_s = _level_hit_s(position, recorded, scene)
    else:
        hit_s = _hit_s(position, recorded, scene.half_length_m)
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
        if (hit := hit_s[i]) is not None:
            label[i][times > hit] = PHASES.index("after")
            label[i][np.abs(times - hit) <= COLLISION_S] = PHASES.index("collision")
        label[i][times < 0 if scene.starts_moving else times <= 0] = PHASES.index("held")
    return label


def free_phase(scene: Surroundings) -> str:
    """What the motion of an object that slides on nothing is called."""
    usual = "flight" if scene.moves_in_plane else "fall"
    return next((phase for law, phase in FREE.items() if law in scene.laws), usual)


def _hit_s(
    position: np.ndarray, times_s: np.ndarray, half_length_m: tuple[float, ...]
) -> list[float | None]:
    """When each object first touches a neighbour; None where it does not."""
    found: list[float | None] = [None] * len(position)
    for i in range(len(position) - 1):
        gap = position[i + 1, 0] - position[i, 0] - half_length_m[i] - half_length_m[i + 1]
        touching = np.flatnonzero(gap < 1e-4)
        if touching.size:
            hit_s = float(times_s[touching[0]])
            for j in (i, i + 1):
                found[j] = min(hit_s, found[j] or hit_s)
    return found


def _level_hit_s(
    position: np.ndarray, times_s: np.ndarray, scene: Surroundings
) -> list[float | None]:
    """As `_hit_s`, of discs seen from above: any two may touch, or one a wall."""
    found: list[float | None] = [None] * len(position)
    radius_m = scene.half_length_m
    for i, j in combinations(range(len(position)), 2):
        apart = np.linalg.norm(position[j, :2] - position[i, :2], axis=0)
        # Between two records they come nearer than in either.
        step = np.abs(np.diff(apart, append=apart[-1:]))
        touching = np.flatnonzero(apart - radius_m[i] - radius_m[j] < 1e-4 + step)
        if touching.size:
            hit_s = float(times_s[touching[0]])
            for k in (i, j):
                found[k] = min(hit_s, found[k] or hit_s)
    for i, ends in product(range(len(position)), scene.walls_m):
        away = distance_to_wall(np.moveaxis(position[i, :2], 0, -1), ends)
        step = np.abs(np.diff(away, append=away[-1:]))
        touching = np.flatnonzero(away - radius_m[i] < 1e-4 + step)
        if touching.size:
            hit_s = float(times_s[touching[0]])
            found[i] = min(hit_s, found[i] or hit_s)
    return found

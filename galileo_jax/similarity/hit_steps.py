"""The step that a hit leaves in the track of whoever is in it, as covariance (see `discrepancy`).

A real hit takes a millisecond or two, a rigid one none, and what bodies pass meanwhile is in all
places after it: at 0.1 m/s a tenth of a millimetre.
"""

from itertools import combinations, product

import numpy as np

from galileo_jax.clip.walls import bounces
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.observation.observation import Observation
from galileo_jax.statespace.kinematics import first_moved

STEP_SD_M = 1e-4
NEAR = 1.15  # of the sum of the radii: so near are pucks that hit each other in some frame


def hit_steps(observation: Observation, scene: Surroundings) -> list[np.ndarray]:
    """The patterns times their standard deviations, each `[object, axis, frame]`, m."""
    position = np.nan_to_num(observation.position_m)
    hits, axes = _on_path(observation), (0,)
    if scene.is_level:
        hits, axes = _from_above(observation, scene), (0, 1)
    found = []
    for (i, frame), axis in product(hits, axes):
        step = np.zeros_like(position)
        step[i, axis, frame + 1 :] = STEP_SD_M
        found.append(step)
    return found


def _on_path(observation: Observation) -> list[tuple[int, int]]:
    """Who is hit, or hits, and in which frame."""
    found = []
    for i in range(1, len(observation.mask)):
        moved = first_moved(observation.position_m[i, 0], observation.mask[i])
        if moved is not None:
            found += [(i - 1, max(moved - 1, 0)), (i, max(moved - 1, 0))]
    return found


def _from_above(observation: Observation, scene: Surroundings) -> list[tuple[int, int]]:
    """As `_on_path`, of pucks and walls."""
    position, found = np.nan_to_num(observation.position_m[:, :2]), []
    for i, j in combinations(range(len(position)), 2):
        both = observation.mask[i] & observation.mask[j]
        apart = np.where(both, np.linalg.norm(position[j] - position[i], axis=0), np.inf)
        if apart.min() <= NEAR * (scene.half_length_m[i] + scene.half_length_m[j]):
            found += [(i, int(np.argmin(apart))), (j, int(np.argmin(apart)))]
    for i, ends in product(range(len(position)), scene.walls_m):
        every = bounces(position[i], observation.mask[i], ends, scene.half_length_m[i])
        found += [(i, hit) for hit in every]
    return found

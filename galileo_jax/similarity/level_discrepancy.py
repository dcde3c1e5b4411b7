"""What is imperfect in measurements of pucks seen from above, as covariance (see `discrepancy`).

Offsets of each puck and axis; what camera and tracker do, which wander by tenths of a pixel; a real
hit's duration; and, where the turning is known, a followed point that is not the centre, which goes
round it. All of the wander counts: at hundreds of frames per second even its fast part is as large
as the scatter, and neighbouring errors of what lies still go together.
"""

from itertools import combinations, product

import numpy as np

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.numerics.line_segments import NEAR, nearest_frames
from galileo_jax.numerics.random_patterns import alone
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.discrepancy import WOBBLE_S, WOBBLE_SD_M, camera, offsets, wander
from galileo_jax.similarity.hit_discrepancy import HIT_STEP_SD_M

CENTRE_SHARE = 0.1  # of a radius: how far a followed point may be from the centre


def level_modes(observation: Observation, scene: Surroundings, is_filmed: bool) -> np.ndarray:
    """The patterns times their standard deviations, `[mode, object, axis, frame]`, m (and rad)."""
    position = np.nan_to_num(observation.position_m)
    found = offsets(observation)
    if is_filmed:
        turning = position.shape[1] - 2
        for pattern in camera(position[:, :2], observation, scene):
            found.append(np.pad(pattern[:, :2], [(0, 0), (0, turning), (0, 0)]))
        size_m = WOBBLE_SD_M if observation.wander_m is None else observation.wander_m
        found.extend(wander(observation, size_m, WOBBLE_S, smallest=0.0))
    hits = list[tuple[int, int]]()  # frame and object
    for i, j in combinations(range(len(position)), 2):
        apart = observation.apart_m(i, j)
        if apart.min() <= NEAR * (scene.half_length_m[i] + scene.half_length_m[j]):
            hits += [(int(np.argmin(apart)), i), (int(np.argmin(apart)), j)]
    for i, ends in product(range(len(position)), scene.walls_m):
        half_m = scene.half_length_m[i]
        at_wall = nearest_frames(position[i, :2], observation.mask[i], ends, half_m)
        hits += [(frame, i) for frame in at_wall]
    for hit, i in hits:
        later = slice(hit + 1, None)
        found += [alone(position, i, axis, HIT_STEP_SD_M, later) for axis in range(2)]
    turned = position[:, 2] if observation.is_turning else observation.turned_rad
    if turned is not None:
        found.extend(_off_centre(position, turned, scene))
    return np.stack(found)


def _off_centre(
    position: np.ndarray, turned_rad: np.ndarray, scene: Surroundings
) -> list[np.ndarray]:
    """A point that is off its puck's centre, along x and along y when it is first seen.

    Of a puck that does not show how it turns nothing is known to be marked but the middle.
    """
    found = []
    for i, turned in enumerate(turned_rad):
        known = np.flatnonzero(np.isfinite(turned))
        if not known.size:
            continue
        turned = np.nan_to_num(turned - turned[known[0]])  # unseen frames count for nothing
        size = CENTRE_SHARE * scene.half_length_m[i]
        for x, y in ((np.cos(turned), np.sin(turned)), (-np.sin(turned), np.cos(turned))):
            own = np.zeros_like(position)
            own[i, 0], own[i, 1] = size * x, size * y
            found.append(own)
    return found

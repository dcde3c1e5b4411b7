"""What a box does that rocks on an edge, as covariance (see `discrepancy`).

A tall box that reaches the foot of a ramp, or is hit above its middle, tips forward and falls back
onto its face: for a tenth of a second or two it stands on an edge. That lifts its centre, which
the path shows, and no other imperfection lifts it for so short a time. By as much as it turns its
centre also goes ahead of its face or stays behind it, which is what the model, whose bodies do not
turn, does not know: these frames say little, and where it goes on from is not quite known.
"""

import numpy as np

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.numerics.random_patterns import alone
from galileo_jax.observation.observation import Observation

RISES_M = 1.2e-3  # three times what bodies wobble across their path (`discrepancy.WOBBLE_SD_M`)
CLEAR = 5.0  # standard deviations of a frame
TILTED_M, TILTED_SD = 6e-4, 2.0  # what is lifted by more, beside the highest frame, rocks with it
LONGEST_S = 0.4  # a box that does not come down again does not rock
FEWEST_FRAMES = 8  # on the table, to tell its level
LEVEL = 0.25  # which quantile of heights lies on it: rocking only lifts
NUM_ROUNDS = 30


def rocking(
    position: np.ndarray, observation: Observation, scene: Surroundings, i: int, past: np.ndarray
) -> list[tuple[slice, float]]:
    """When object `i` rocks on the table: frames, from the first to the last, and its rise, m.

    `position`: without NaN. `past`: `[frame]`, where it is wholly past the foot.
    """
    if not scene.has_table or (scene.rolls and scene.rolls[i]):
        return []
    on_table = np.flatnonzero(past & observation.mask[i])
    if len(on_table) < FEWEST_FRAMES:
        return []
    x, y = position[i][:, on_table]
    above = y - level(x, y)
    sd = np.sqrt(observation.covariance_m2[i, 1, 1, on_table])
    found, is_free = [], np.ones(len(on_table), bool)
    for top in np.argsort(-above):
        if above[top] < max(RISES_M, CLEAR * sd[top]):
            break
        if not is_free[top]:
            continue
        is_up = above > np.maximum(TILTED_M, TILTED_SD * sd)
        first = top - int(np.argmin(np.append(is_up[top::-1], False))) + 1
        last = top + int(np.argmin(np.append(is_up[top:], False))) - 1
        is_free[first : last + 1] = False
        frames = on_table[first], on_table[last]
        if observation.times_s[frames[1]] - observation.times_s[frames[0]] <= LONGEST_S:
            found.append((slice(int(frames[0]), int(frames[1]) + 1), float(above[top])))
    return found


def level(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """The heights at `x` `[frame]` of a straight line below which a quarter of all heights lie.

    By least squares again and again, each weighted so that they become the quantile's distances.
    """
    design = np.stack([np.ones_like(x), x - x.mean()], axis=1)
    if np.ptp(x) < RISES_M:  # at rest: no slope to be told
        design = design[:, :1]
    line = np.full_like(y, np.median(y))
    for _ in range(NUM_ROUNDS):
        off = y - line
        weight = np.where(off > 0, LEVEL, 1 - LEVEL) / np.maximum(np.abs(off), 1e-6)
        root = np.sqrt(weight)
        line = design @ np.linalg.lstsq(design * root[:, None], y * root, rcond=None)[0]
    return line


def rocking_steps(
    position: np.ndarray, scene: Surroundings, i: int, when: list[tuple[slice, float]]
) -> list[np.ndarray]:
    """For each time that object `i` rocks, the step that it leaves behind in its way."""
    found = []
    for frames, rise in when:
        done = np.arange(position.shape[-1]) - frames.start + 1
        share = np.clip(done / (frames.stop - frames.start), 0.0, 1.0)
        found.append(alone(position, i, 0, _ahead(rise, scene, i) * share))
    return found


def rocking_frames(
    position: np.ndarray, scene: Surroundings, i: int, when: list[tuple[slice, float]]
) -> list[np.ndarray]:
    """The modes of each single frame in which object `i` rocks."""
    return [
        alone(position, i, axis, size, slice(frame, frame + 1))
        for frames, rise in when
        for frame in range(frames.start, frames.stop)
        for axis, size in ((0, _ahead(rise, scene, i)), (1, rise))
    ]


def _ahead(rise_m: float, scene: Surroundings, i: int) -> float:
    """How far turning that lifts a centre by so much takes it ahead of the middle of its face."""
    return rise_m * scene.half_height_m[i] / scene.half_length_m[i]

"""Sizes that nobody measured, as far as a motion down a ramp shows them.

    half height   of a centre above the table, or above the ramp
    half lengths  their sum is the distance of the centres when objects hit

Only these enter the model of a ramp that ends on a table; on one slope no size does.
"""

import math
from collections.abc import Mapping

import numpy as np

from galileo_jax.clip.fields import MAX_SIZE_M, MIN_SIZE_M
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.observation.observation import Observation

SIZE_SD_M = 0.003
"""A marked point is the centre within this, and a height or a distance of centres no better."""

NUM_BESIDE = 3
"""Frames on either side of a hit through which the distance's two lines are laid."""

CLEARLY = 5.0
"""Standard deviations by which an object must move to have been hit."""


def needs_sizes(clip: Clip) -> bool:
    """Whether a size is missing that the model needs."""
    has_table = SCENARIOS[clip.scenario].has_table
    return has_table and any(item.size_m is None for item in clip.objects)


def infer_sizes(clip: Clip, observation: Observation) -> Mapping[str, tuple[float, ...]]:
    """`size_m` by name of the objects that have none.

    Args:
      clip: with its ramp's angle.
      observation: the tracked points, which are taken for the objects' centres.
    """
    from galileo_jax.model.scene.scene import extents

    angle = math.radians(clip.ramp_angle_deg or 0.0)
    heights = [
        extents(item)[1] if item.size_m else _height(observation, k, angle)
        for k, item in enumerate(clip.objects)
    ]
    lengths = [
        extents(item)[0] if item.size_m else None for item in clip.objects
    ]  # half, as `heights`
    for k in range(len(lengths) - 1):
        apart = distance_at_hit(observation, k)
        pair = lengths[k], lengths[k + 1]
        if apart is None or None not in pair:
            continue
        known = sum(length for length in pair if length is not None)
        share = max((apart - known) / pair.count(None), MIN_SIZE_M / 2)
        lengths[k], lengths[k + 1] = (share if length is None else length for length in pair)
    return {
        item.name: _size(item, length or height, height)
        for item, length, height in zip(clip.objects, lengths, heights, strict=True)
        if item.size_m is None
    }


def _height(observation: Observation, k: int, angle: float) -> float:
    """Of the centre above the surface, m."""
    x, y = observation.position_m[k][:, observation.mask[k]]
    if not x.size:
        return MIN_SIZE_M  # never seen: building the scene refuses it
    above_ramp = y * math.cos(angle) + x * math.sin(angle)
    height = float(np.median(y[x > 0] if (x > 0).any() else above_ramp))
    return float(np.clip(height, MIN_SIZE_M / 2, MAX_SIZE_M / 2))


def distance_at_hit(observation: Observation, k: int) -> float | None:
    """Between the centres of objects k and k + 1 when the one hits the other, m; None if never."""
    both = observation.mask[k] & observation.mask[k + 1]
    first, second = observation.position_m[k, 0, both], observation.position_m[k + 1, 0, both]
    if both.sum() < 2 * NUM_BESIDE + 1:
        return None
    noise = math.sqrt(float(np.median(observation.covariance_m2[k + 1, 0, 0, both])))
    gone = second - np.median(second[:NUM_BESIDE])
    if np.median(gone[-NUM_BESIDE:]) < CLEARLY * noise:
        return None
    apart, times = second - first, observation.times_s[both]
    at = int(np.argmax(gone > CLEARLY * noise))
    before, after = slice(max(at - 1 - NUM_BESIDE, 0), at - 1), slice(at, at + NUM_BESIDE)
    if before.stop - before.start < 2 or len(apart[after]) < 2:
        return float(apart.min())
    down, up = (np.polyfit(times[part], apart[part], 1) for part in (before, after))
    if down[0] >= up[0] - 1e-9:
        return float(apart.min())
    when = (up[1] - down[1]) / (down[0] - up[0])
    return float(np.polyval(up, when))


def _size(item: ClipObject, half_length: float, half_height: float) -> tuple[float, ...]:
    """The size of its shape with these extents, as `extents` reads it; a box is as deep as long."""
    match item.shape:
        case "box":
            size = (2 * half_length, 2 * half_length, 2 * half_height)
        case "cylinder":
            size = (half_length, 2 * half_height)
        case "torus":
            size = (max(half_length - half_height, 1.01 * half_height), half_height)
        case _:
            size = (half_height,)
    return tuple(round(float(np.clip(value, MIN_SIZE_M, MAX_SIZE_M)), 4) for value in size)

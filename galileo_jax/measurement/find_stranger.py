"""Pucks that are struck where none of the others and no wall is: by something not in the scene."""

from dataclasses import replace

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.clip.walls import distance_to_wall
from galileo_jax.measurement.find_blow import SMEARED, blow_frame
from galileo_jax.observation.observation import Observation

NEAR = 1.15  # of the sum of the radii: so near are pucks that hit each other
STEPS_ON_WAY = 9  # places between two frames at which distances are looked at


def stranger_frame(clip: Clip, observation: Observation) -> tuple[int, int] | None:
    """The last frame before the first blow without a partner, and whose it is; None without."""
    found = [
        (frame, i)
        for i in range(len(observation.names))
        if (frame := _first(clip, observation, i)) is not None
    ]
    return min(found) if found else None


def _first(clip: Clip, observation: Observation, i: int) -> int | None:
    """Of puck `i`; blows with a partner are passed over."""
    mask = observation.mask.copy()
    while (last := blow_frame(replace(observation, mask=mask), i, from_rest=True)) is not None:
        if not _has_partner(clip, observation, i, last):
            return last
        mask[i, : last + SMEARED + 1] = False
    return None


def _has_partner(clip: Clip, observation: Observation, i: int, last: int) -> bool:
    """Whether another puck or a wall is near in the frames of a blow, or one may be, unseen."""
    frames = slice(last, last + SMEARED + 1)
    place, radius = observation.position_m[:, :2, frames], _radius_m(clip, i)
    own = _on_way(place[i])
    if not np.isfinite(own).all():
        return True
    if any(distance_to_wall(own.T, wall.ends_m).min() < NEAR * radius for wall in clip.walls):
        return True
    for j in range(len(place)):
        apart = np.linalg.norm(_on_way(place[j]) - own, axis=0)
        if j != i and not apart.min() > NEAR * (radius + _radius_m(clip, j)):
            return True
    return False


def _on_way(place: np.ndarray) -> np.ndarray:
    """Places `[2, frame]` and those between them."""
    frames = place.shape[1]
    between = np.linspace(0, frames - 1, (frames - 1) * (STEPS_ON_WAY - 1) + 1)
    return np.stack([np.interp(between, np.arange(frames), row) for row in place])


def _radius_m(clip: Clip, i: int) -> float:
    return (clip.objects[i].size_m or (0.0,))[0]

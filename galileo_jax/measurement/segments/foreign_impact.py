"""Pucks that are struck where none of the others and no wall is: by something not in the scene.

A hard blow is looked for from step to step, a soft one over several: of what strikes a puck within
three frames of a hit that is of the scene only the hard one is told from that hit.
"""

from dataclasses import replace

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.segments.blow import CLEAR, HIT_M_S2, SMEARED, STEPS, blow_frame, jumps
from galileo_jax.numerics.line_segments import NEAR, distance_to_segment
from galileo_jax.observation.observation import Observation

STEPS_ON_WAY = 9  # places between two frames at which distances are looked at


def stranger_frame(clip: Clip, observation: Observation) -> tuple[int, int] | None:
    """The last frame before the first blow without a partner, and whose it is; None without."""
    found = [
        (frame, i)
        for i in range(len(observation.names))
        for frame in (_hard(clip, observation, i), _soft(clip, observation, i))
        if frame
    ]
    return min(found, default=None)


def _hard(clip: Clip, observation: Observation, i: int) -> int | None:
    """The last frame before a blow that is clear from one step to the next."""
    path = observation.path(i)
    for at in np.flatnonzero(jumps(path, HIT_M_S2, CLEAR)):
        if not _has_partner(clip, observation, i, slice(path.frames[at], path.frames[at + 2] + 1)):
            return int(path.frames[at])
    return None


def _soft(clip: Clip, observation: Observation, i: int) -> int | None:
    """The last frame before a blow that shows in several steps."""
    mask = observation.mask.copy()
    while (last := blow_frame(replace(observation, mask=mask), i, from_rest=True)) is not None:
        # Where two blows follow each other at once, either may seem to be between them.
        frames = slice(max(last - STEPS, 0), last + SMEARED + STEPS)
        if not _has_partner(clip, observation, i, frames):
            return last
        mask[i, : last + SMEARED + 1] = False
    return None


def _has_partner(clip: Clip, observation: Observation, i: int, frames: slice) -> bool:
    """Whether another puck or a wall is near in some frames, or one may be, unseen.

    It may be so near between two of them, by half of what both go from one to the next.
    """
    place = observation.position_m[:, :2, frames]
    radii = [(item.size_m or (0.0,))[0] for item in clip.objects]
    own = _on_way(place[i])
    if not np.isfinite(own).all():
        return True
    reach = NEAR * np.array(radii) + np.linalg.norm(np.diff(place), axis=1).max(axis=1) / 2
    if any(distance_to_segment(own.T, wall.ends_m).min() < reach[i] for wall in clip.walls):
        return True
    return any(
        j != i and not np.linalg.norm(_on_way(other) - own, axis=0).min() > reach[i] + reach[j]
        for j, other in enumerate(place)
    )


def _on_way(place: np.ndarray) -> np.ndarray:
    """Places `[2, frame]` and those between them."""
    frames = place.shape[1]
    between = np.linspace(0, frames - 1, (frames - 1) * (STEPS_ON_WAY - 1) + 1)
    return np.stack([np.interp(between, np.arange(frames), row) for row in place])

"""Pucks that are struck where none of the others and no wall is: by something not in the scene.

A hard blow is looked for from step to step, a soft one over several: of what strikes a puck within
three frames of a hit that is of the scene only the hard one is told from that hit.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool

from galileo_jax.clip.schema import Clip
from galileo_jax.clip.walls import distance_to_wall
from galileo_jax.measurement.segments.blow import CLEAR, HIT_M_S2, SMEARED, STEPS, blow_frame
from galileo_jax.observation.observation import Observation, PointPath

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
    found = [frame for frame in (_hard(clip, observation, i), _soft(clip, observation, i)) if frame]
    return min(found) if found else None


def _hard(clip: Clip, observation: Observation, i: int) -> int | None:
    """The last frame before a blow that is clear from one step to the next."""
    path = observation.path(i)
    for at in np.flatnonzero(jumps(path, HIT_M_S2, CLEAR)):
        if not _has_partner(clip, observation, i, slice(path.frames[at], path.frames[at + 2] + 1)):
            return int(path.frames[at])
    return None


def jumps(path: PointPath, most_m_s2: float, clear: float) -> Bool[np.ndarray, " middle"]:
    """Whether the velocity changes beyond an acceleration and noise, for each place but the ends.

    Args:
      path: of an object.
      most_m_s2: nothing but a blow accelerates so.
      clear: standard deviations of the change that are no noise.
    """
    step_s, velocity, sd = path.steps
    change = np.linalg.norm(np.diff(velocity[:2]), axis=0)
    return change > most_m_s2 * (step_s[1:] + step_s[:-1]) / 2 + clear * np.hypot(sd[1:], sd[:-1])


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

    It may be so near between two of them, by half of what the puck goes from one to the next.
    """
    place, radius = observation.position_m[:, :2, frames], _radius_m(clip, i)
    own = _on_way(place[i])
    if not np.isfinite(own).all():
        return True
    reach = NEAR * radius + np.linalg.norm(np.diff(place[i]), axis=0).max() / 2
    if any(distance_to_wall(own.T, wall.ends_m).min() < reach for wall in clip.walls):
        return True
    for j in range(len(place)):
        apart = np.linalg.norm(_on_way(place[j]) - own, axis=0)
        if j != i and not apart.min() > reach + NEAR * _radius_m(clip, j):
            return True
    return False


def _on_way(place: np.ndarray) -> np.ndarray:
    """Places `[2, frame]` and those between them."""
    frames = place.shape[1]
    between = np.linspace(0, frames - 1, (frames - 1) * (STEPS_ON_WAY - 1) + 1)
    return np.stack([np.interp(between, np.arange(frames), row) for row in place])


def _radius_m(clip: Clip, i: int) -> float:
    return (clip.objects[i].size_m or (0.0,))[0]

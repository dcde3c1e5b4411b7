"""When all that is seen has come to rest: after that a film shows only how its camera drifts."""

import numpy as np

from galileo_jax.observation.observation import Observation

REST_S = 0.25  # looked at so long after the last motion: that it ends belongs to it
STILL_SHARE = 0.05  # of a radius: whoever stays so near to where it ends is at rest


def rest_frame(observation: Observation, radius_m: float) -> int | None:
    """The last frame worth a look; None where something moves to the end, or almost so.

    Args:
      observation: of all objects, `[object, axis, frame]`; x and y count.
      radius_m: of the smallest object.
    """
    last = []
    for place, seen in zip(observation.position_m[:, :2], observation.mask, strict=True):
        frames = np.flatnonzero(seen)
        if not frames.size:
            continue
        end = place[:, frames[-max(len(frames) // 8, 1) :]].mean(axis=1)
        away = np.linalg.norm(place[:, frames] - end[:, None], axis=0) > STILL_SHARE * radius_m
        last.append(frames[np.flatnonzero(away)[-1]] if away.any() else frames[0])
    if not last:
        return None
    times = observation.times_s
    end = int(np.searchsorted(times, times[max(last)] + REST_S))
    seen = np.flatnonzero(observation.mask.any(axis=0))
    return end if end < seen[-1] else None

"""An object that comes back along the table to the ramp that it came down.

A spring pulls it, or a heavy partner throws it back. Where its rear edge meets the foot it is
stopped or turned by a corner, at an angle that points on a line have no part in: what follows is
not of the scene. It has come back if it goes backwards with its centre less than half its length
and MARGIN past the foot, after it was BEYOND farther than that.
"""

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation

MARGIN_M = 3e-3  # what a point is off the centre
BEYOND_M = 5e-3
CLEAR = 5.0  # standard deviations that it has come back at least


def return_frame(clip: Clip, observation: Observation, index: int) -> int | None:
    """The last frame before an object that came down comes back to the foot; None: it does not."""
    from galileo_jax.model.scene.scene import extents

    item, seen = clip.objects[index], np.flatnonzero(observation.mask[index])
    if item.size_m is None or not seen.size:
        return None
    x = observation.position_m[index, 0, seen]
    sd = np.sqrt(np.median(observation.covariance_m2[index, 0, 0, seen]))
    near = extents(item)[0] + MARGIN_M
    farthest = np.maximum.accumulate(x)
    came_back = farthest - x > BEYOND_M + CLEAR * sd
    returns = (x[0] < 0.0) & came_back & (x < near)
    if not returns.any():
        return None
    first = int(np.argmax(returns))
    return int(seen[first - 1]) if first else None

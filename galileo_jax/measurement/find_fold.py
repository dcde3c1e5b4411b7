"""Two bodies of which one pushes the other, until they turn aside.

To push from behind is unstable: boxes that touch turn, the one to the left, the other to the right,
and slide past each other. Seen from the side their centres come closer than they were when they
touched, which nothing that slides along a line can do. They have turned aside if, for three frames,

    d < d_hit - CLOSER  and  d < half the declared lengths - CLOSER

d_hit being the distance at the hit, which is where the lines through it before and after meet.
"""

import math

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.infer_sizes import distance_at_hit
from galileo_jax.observation.observation import Observation

CLOSER_M = 2e-3  # what a hit's distance is known to
CLEAR = 4.0  # standard deviations of a distance in three frames
BEGINS_M = 5e-4
FRAMES = 3


def fold_frame(clip: Clip, observation: Observation, front: int) -> int | None:
    """The last frame before object `front` and the one behind it turn aside; None: they do not."""
    from galileo_jax.model.scene.scene import extents

    pair = clip.objects[front - 1 : front + 1]
    hit_m = distance_at_hit(observation, front - 1)
    if hit_m is None or any(item.size_m is None for item in pair):
        return None
    both = np.flatnonzero(observation.mask[front - 1] & observation.mask[front])
    x, variance = observation.position_m[:, 0], observation.covariance_m2[:, 0, 0]
    apart = (x[front] - x[front - 1])[both]
    sd = math.sqrt(float(np.median((variance[front] + variance[front - 1])[both])))
    touching = min(hit_m, sum(extents(item)[0] for item in pair))
    mean = np.convolve(apart, np.full(FRAMES, 1 / FRAMES), "valid")
    closer = touching - mean
    if not (closer > CLOSER_M + CLEAR * sd / math.sqrt(FRAMES)).any():
        return None
    first = int(np.argmax(closer > CLOSER_M + CLEAR * sd / math.sqrt(FRAMES)))
    before = np.flatnonzero(closer[:first] < BEGINS_M)
    return int(both[before[-1] + FRAMES // 2]) if before.size else None

"""A stop: something that is not in the scene ends the motion.

A board may end at a stop, and below a dropped object is the ground. With v_i the speed in the
direction of motion, the object is stopped at step i if

    v_i < SLOWED v,   and no v_j > SLOWED v after it,   v = median of steps i - 2, i - 3, i - 4
    v_(i-2) > STEADY v                                  (what brakes slows down step by step)
    (v - v_i) / n steps > HIT_M_S2                      (and no friction brakes like a wall)
    v > CLEAR standard deviations of a step

n is 1, or 2 where the hit is smeared over two steps: v_(i-1) < STEADY v.
"""

import numpy as np

from galileo_jax.observation.observation import Observation

SLOWED, STEADY = 0.6, 0.9
HIT_M_S2 = 20.0
"""Two g; friction takes less than one."""
CLEAR = 5.0
BEFORE = 3
SMEARED_FRAMES = 1
"""Of a video: the hit falls into an exposure, whose frame shows neither."""


def arrest_frame(observation: Observation) -> int | None:
    """The last frame before object 1 is stopped within one step; None where it is not."""
    seen = np.flatnonzero(observation.mask[0])
    times_s, place_m = observation.times_s[seen], observation.position_m[0][:, seen]
    step_s = np.diff(times_s)
    velocity = np.diff(place_m) / step_s
    along = observation.variance_m2[0, seen]
    speed_sd = np.sqrt(along[1:] + along[:-1]) / step_s
    for i in range(BEFORE + 1, len(step_s)):
        way = velocity[:, i - 1 - BEFORE : i - 1].sum(axis=1)
        going = way @ velocity / max(float(np.hypot(*way)), np.finfo(float).tiny)
        usual = np.median(going[i - 1 - BEFORE : i - 1])
        is_clear = usual > CLEAR * np.median(speed_sd[i - 1 - BEFORE : i - 1])
        is_smeared = going[i - 1] <= STEADY * usual
        braked_m_s2 = (usual - going[i]) / (step_s[i] * (2 if is_smeared else 1))
        is_hit = braked_m_s2 > HIT_M_S2 and going[i - 2] > STEADY * usual
        if is_clear and is_hit and going[i:].max() < SLOWED * usual:
            return int(seen[i - 1 if is_smeared else i])
    return None

"""How pucks seen from above move when they are first seen: priors of their start velocities."""

import math

import numpy as np

from galileo_jax.model.effects.laws.pucks import OFFSET, START
from galileo_jax.observation.observation import Observation

FRAMES = 8  # through which a straight line is laid
MOVES_SD = 5.0  # of that line's slope: what is slower rests
SHARE, LEAST_M_S, LEAST_RAD_S = 0.3, 0.05, 1.0  # widths of the priors
OFFSET_SHARE = 0.1  # of a radius: a point that was marked is the centre within this


def level_starts(observation: Observation, radius_m: float) -> dict[str, tuple[float, float]]:
    """The two numbers of each prior, by the parameter's name; nothing of pucks that rest.

    Args:
      observation: its first frames are the begin of the motion.
      radius_m: of the first puck.
    """
    found = {OFFSET: (0.0, OFFSET_SHARE * radius_m)}
    for i, (place, mask) in enumerate(zip(observation.position_m, observation.mask, strict=True)):
        seen = np.flatnonzero(mask)[:FRAMES]
        if len(seen) < 3:
            continue
        after = observation.times_s[seen] - observation.times_s[seen[0]]
        speed = np.polyfit(after, place[:, seen].T, 1)[0]
        variance = np.diagonal(observation.covariance_m2[i][:, :, seen]).mean(axis=0)
        sd = np.sqrt(variance / np.sum((after - after.mean()) ** 2))
        if not np.any(np.abs(speed) > MOVES_SD * sd):
            continue
        # A parabola's slope where it begins: friction has not yet acted.
        speed = np.polyfit(after, place[:, seen].T, min(2, len(seen) - 1))[-2]
        widths = (*[SHARE * math.hypot(*speed[:2]) + LEAST_M_S] * 2, LEAST_RAD_S)
        for axis, name in enumerate(START[: len(place)]):
            width = widths[axis] + (SHARE * abs(speed[axis]) if axis == 2 else 0.0)
            found[f"{name}{i + 1}"] = float(speed[axis]), float(width)
    return found

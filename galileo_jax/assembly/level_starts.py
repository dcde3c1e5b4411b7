"""How pucks seen from above move when they are first seen: priors of their start velocities."""

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from galileo_jax.clip.walls import Wall
from galileo_jax.model.effects.laws.pucks import OFFSET, START
from galileo_jax.numerics.least_squares import polynomial
from galileo_jax.numerics.line_segments import distance_to_segment
from galileo_jax.observation.observation import Observation

FRAMES = 8  # through which a straight line is laid
MOVES_SD = 5.0  # of that line's slope: what is slower rests
SHARE, LEAST_M_S, LEAST_RAD_S = 0.3, 0.05, 1.0  # widths of the priors
# Of a puck whose turning is seen and not fitted: that long, and how well its picture shows it.
TURNING_S, TURNING_SD, TURNED_SD_RAD = 0.1, (0.05, 0.02), 2e-3  # rad/s and a share, rad
OFFSET_SHARE = 0.1  # of a radius: a point that was marked is the centre within this


def level_starts(
    observation: Observation, radius_m: float, walls: Sequence[Wall] = ()
) -> dict[str, tuple[float, float]]:
    """The two numbers of each prior, by the parameter's name; nothing of pucks that rest.

    The motion begins with the observation's first frames; `radius_m` is that of the first puck.
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
        if (turning := _turning(observation, i, walls)) is not None:
            found[f"{START[2]}{i + 1}"] = turning
    return found


def _turning(observation: Observation, i: int, walls: Sequence[Wall]) -> tuple[float, float] | None:
    """How fast a puck turns at the start by its picture, and sd, rad/s; None where unknown.

    Friction acts against sliding and turning together: who turns slides farther.
    """
    if observation.turned_rad is None:
        return None
    seen = np.flatnonzero(observation.mask[i] & np.isfinite(observation.turned_rad[i]))
    times, seen = observation.times_s, seen[seen < _first_hit(observation, i, walls)]
    is_early = times[seen] <= times[seen[:1]] + TURNING_S
    seen = seen[is_early | (np.arange(len(seen)) < FRAMES)]
    if len(seen) <= 3:
        return None
    after, turned = times[seen] - times[seen[0]], np.unwrap(observation.turned_rad[i, seen])
    fit = polynomial(after, turned, 2)
    scatter = np.sum(fit.left**2) / (len(seen) - 3)
    variance = max(float(scatter), TURNED_SD_RAD**2) * fit.inverse[1, 1]
    speed, (least, share) = float(fit.solution[1]), TURNING_SD
    return speed, math.hypot(math.sqrt(variance), least + share * abs(speed))


def _first_hit(observation: Observation, own: int, walls: Sequence[Wall]) -> int:
    """The frame in which two pucks are nearest to each other, or one to a wall.

    Behind the last where there is nothing to hit.

    After it another turning may have begun.
    """
    pairs = combinations(range(len(observation.names)), 2)
    apart = [observation.apart_m(i, j) for i, j in pairs]
    place, is_seen = observation.position_m[own, :2].T, observation.mask[own]
    to_walls = (distance_to_segment(place, wall.ends_m) for wall in walls)
    apart += [np.where(is_seen, away, np.inf) for away in to_walls]
    nearest = (int(np.argmin(away)) for away in apart if np.isfinite(away).any())
    return min(nearest, default=len(observation.times_s))

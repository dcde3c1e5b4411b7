"""A hand that still moves the object: it comes free later than it begins to move.

On a board what is let go accelerates at once about as it will on the way. While a finger still
holds or pushes it, it does not. With a the acceleration of a parabola through a window, and a_way
the usual one of the way from WAY[0] to WAY[1] of its length, the hand is on as long as, within
the first EARLY of the way,

    a < HELD a_way   or   a > PUSHED a_way,     by CLEAR standard deviations of a

The windows begin where the object has clearly left its place, so that none lies across a release
from rest.
"""

import numpy as np

from galileo_jax.observation.observation import Observation

HELD, PUSHED, CLEAR = 0.5, 2.0, 4.0
WAY, EARLY = (0.15, 0.7), 0.2  # shares of the length of the way
WINDOW_SHARE, FEWEST = 0.05, 6  # of the frames in motion; frames
PUSHED_WAY = 0.5  # of the way on a level table
MOST_SPREAD = 0.5  # of a_way within the way: what accelerates so unevenly has no usual way


def hand_frame(observation: Observation) -> int | None:
    """The first frame in which object 1 is free of the hand that moves it; None: at once."""
    seen = np.flatnonzero(observation.mask[0])
    if len(seen) < 4 * FEWEST:
        return None
    times_s, place_m = observation.times_s[seen], observation.position_m[0][:, seen]
    variance = np.einsum("iit->t", observation.covariance_m2[0][..., seen]) / 2
    gone, length = _gone(place_m)
    left = gone > CLEAR * np.sqrt(variance + variance[0]) + 1e-3 * length
    began = len(left) - int(np.argmin(np.append(left[::-1], False)))
    size = max(FEWEST, round(WINDOW_SHARE * (len(seen) - began)))
    if began == 0 or len(seen) - began < 4 * size:
        return None  # it moves when it is first seen: whoever let it go is not in the clip
    starts = np.arange(began, len(seen) - size)
    found, sd = _accelerations(times_s, gone, variance, starts, size)
    middle = gone[starts + size // 2] / length
    on_way = (middle > WAY[0]) & (middle < WAY[1])
    if on_way.sum() < size:
        return None
    low, usual, high = np.quantile(found[on_way], [0.25, 0.5, 0.75])
    if usual <= 0 or high - low > MOST_SPREAD * usual:
        return None
    is_held = (found < HELD * usual) | (found > PUSHED * usual)
    is_held &= (np.abs(found - usual) > CLEAR * sd) & (middle < EARLY)
    if not is_held.any():
        return None
    return int(seen[starts[np.flatnonzero(is_held)[-1]] + size])


def pushed_frame(observation: Observation) -> int | None:
    """The first frame after a push on a level table; None where nothing pushes it at first.

    It gains speed, by `CLEAR` standard deviations of its acceleration in a window, within the first
    half of its way only: what gains speed for longer is pulled by something of the scene.
    """
    seen = np.flatnonzero(observation.mask[0])
    if len(seen) < 4 * FEWEST:
        return None
    times_s, place_m = observation.times_s[seen], observation.position_m[0][:, seen]
    variance = np.einsum("iit->t", observation.covariance_m2[0][..., seen]) / 2
    gone, length = _gone(place_m)
    size = max(FEWEST, round(WINDOW_SHARE * len(seen)))
    starts = np.arange(len(seen) - size + 1)
    found, sd = _accelerations(times_s, gone, variance, starts, size)
    gains = np.flatnonzero(found > CLEAR * sd)
    if not gains.size or gone[gains[-1] + size - 1] > PUSHED_WAY * length:
        return None
    return int(seen[min(gains[-1] + size, len(seen) - 1)])


def _accelerations(
    times_s: np.ndarray, gone: np.ndarray, variance: np.ndarray, starts: np.ndarray, size: int
) -> tuple[np.ndarray, float]:
    """The acceleration in each window of `size` frames, `[window]`, and its standard deviation."""
    found = np.array([_acceleration(times_s, gone, int(i), size) for i in starts])
    step_s = np.median(np.diff(times_s))
    return found, float(np.sqrt(720 * np.median(variance) / size) / (size * step_s) ** 2)


def _gone(place_m: np.ndarray) -> tuple[np.ndarray, float]:
    """How far it is from where it began, towards where it is furthest; and how far that is."""
    began = np.median(place_m[:, :FEWEST], axis=1, keepdims=True)
    furthest = int(np.argmax(np.hypot(*(place_m - began))))
    length = float(np.hypot(*(place_m[:, furthest] - began[:, 0])))
    along = (place_m[:, furthest] - began[:, 0]) / max(length, np.finfo(float).tiny)
    return along @ (place_m - began), length


def _acceleration(times_s: np.ndarray, gone: np.ndarray, start: int, size: int) -> float:
    part = slice(start, start + size)
    return float(2 * np.polyfit(times_s[part] - times_s[start], gone[part], 2)[0])

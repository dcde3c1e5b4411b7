"""A hand that still moves the object: it comes free later than it begins to move.

On a board what is let go accelerates at once about as it will on the way. While a finger still
holds or pushes it, it does not. With a the acceleration of a parabola through a window, and a_way
the usual one of the way from WAY[0] to WAY[1] of its length, the hand is on as long as, within
the first EARLY of the way,

    a < HELD a_way   or   a > PUSHED a_way,     by CLEAR standard deviations of a

The windows begin where the object has clearly left its place, so that none lies across a release
from rest.

What falls or flies has one acceleration, in size and direction, as soon as it is free: the hand is
on where that of a window differs from the usual one by more than `HELD` of it. When it comes free
exactly the parabola of what follows tells, back to the first frame that it does not meet.
"""

import numpy as np

from galileo_jax.measurement.find_blow import continues
from galileo_jax.observation.observation import Observation

HELD, PUSHED, CLEAR = 0.5, 2.0, 4.0
WAY, EARLY = (0.15, 0.7), 0.2  # shares of the length of the way
WINDOW_SHARE, FEWEST = 0.05, 6  # of the frames in motion; frames
PUSHED_WAY = 0.5  # of the way on a level table
LATER = 0.4  # of the windows of what falls or flies: the others tell what is usual
MOST_SPREAD = 0.5  # of a_way within the way: what accelerates so unevenly has no usual way


def hand_frame(observation: Observation) -> int | None:
    """The first frame in which object 1 is free of the hand that moves it; None: at once."""
    seen = np.flatnonzero(observation.mask[0])
    if len(seen) < 4 * FEWEST:
        return None
    times_s, place_m = observation.times_s[seen], observation.position_m[0][:, seen]
    variance = observation.variance_m2[0, seen]
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
    variance = observation.variance_m2[0, seen]
    gone, length = _gone(place_m)
    size = max(FEWEST, round(WINDOW_SHARE * len(seen)))
    starts = np.arange(len(seen) - size + 1)
    found, sd = _accelerations(times_s, gone, variance, starts, size)
    gains = np.flatnonzero(found > CLEAR * sd)
    if not gains.size or gone[gains[-1] + size - 1] > PUSHED_WAY * length:
        return None
    return int(seen[min(gains[-1] + size, len(seen) - 1)])


def thrown_frame(observation: Observation, rest_belongs: bool) -> int | None:
    """The first frame in which object 1 is free of the hand that throws or drops it; None: at once.

    Args:
      observation: the motion of the scene, to where it ends.
      rest_belongs: whether it may lie still at first, without a hand.
    """
    axes = 2 if observation.is_turning else observation.position_m.shape[1]
    seen = np.flatnonzero(observation.mask[0])
    if len(seen) < 3 * FEWEST:
        return None
    times_s, place_m = observation.times_s[seen], observation.position_m[0][:axes, seen]
    variance = observation.variance_m2[0, seen]
    if rest_belongs:
        gone = np.linalg.norm(place_m - place_m[:, :1], axis=0)
        moves = gone > CLEAR * np.sqrt(variance + variance[0]) + 1e-3 * gone.max()
        began = len(moves) - int(np.argmin(np.append(moves[::-1], False)))
        times_s, place_m, variance = times_s[began:], place_m[:, began:], variance[began:]
        seen = seen[began:]
    size, held = max(FEWEST, round(WINDOW_SHARE * len(seen))), -1
    while 3 * size <= len(seen):
        held, is_clear = _last_held(times_s, place_m, variance, size)
        if held >= 0 or is_clear:
            break
        size *= 2  # so short a window does not tell the acceleration
    first = held + size if held >= 0 else 0
    free = slice(first, min(first + max(2 * FEWEST, 2 * size), len(seen)))
    while first > 0 and continues(times_s, place_m, variance, first - 1, free):
        first -= 1
    return int(seen[first]) if first else None


def _last_held(
    times_s: np.ndarray, place_m: np.ndarray, variance: np.ndarray, size: int
) -> tuple[int, bool]:
    """Where the last window with a hand on begins, -1: none; and whether noise lets it show."""
    starts = np.arange(len(times_s) - size + 1)
    each = [_accelerations(times_s, one, variance, starts, size) for one in place_m]
    found, sd = np.array([one for one, _ in each]), max(one for _, one in each)
    velocity = np.gradient(place_m, times_s, axis=1)[:, starts + size // 2]
    is_later = starts >= LATER * len(starts)
    apart, weight = _beside_free(found, velocity, is_later, sd)
    scatter = max(1.4826 * float(np.median(apart[is_later])), sd)
    clear = max(HELD * weight, CLEAR * scatter, CLEAR * float(np.quantile(apart[is_later], 0.75)))
    held = np.flatnonzero((apart > clear) & ~is_later)
    return (int(starts[held[-1]]) if held.size else -1), clear == HELD * weight


def _beside_free(
    found: np.ndarray, velocity: np.ndarray, is_later: np.ndarray, sd: float
) -> tuple[np.ndarray, float]:
    """What the later windows' weight, drag and lift leave of each, `[window]`; and the weight.

    Drag is along the velocity and as its square, lift across it and as itself. How large they may
    be is of the size of the weight.
    """
    speed = np.linalg.norm(velocity, axis=0)
    usual = np.median(found[:, is_later], axis=1)
    weight, top = float(np.linalg.norm(usual)), max(float(speed[is_later].max()), 1e-30)
    air = [-speed * velocity / top**2]
    air += [np.stack([-velocity[1], velocity[0], *(0 * velocity[2:])]) / top]
    axes = [np.broadcast_to(axis[:, None], velocity.shape) for axis in np.eye(len(velocity))]
    columns = np.stack([*axes, *air], axis=-1)  # [axis, window, unknown]
    held_fast = np.diag([*np.zeros(len(axes)), *(2 * [max(sd / max(weight, 1e-30), 1e-6)])])
    design = np.concatenate([columns[:, is_later].reshape(-1, columns.shape[-1]), held_fast])
    seen = np.append(found[:, is_later].reshape(-1), np.zeros(len(held_fast)))
    solution = np.linalg.lstsq(design, seen, rcond=None)[0]
    weight = float(np.linalg.norm(solution[: len(axes)]))
    return np.linalg.norm(found - columns @ solution, axis=0), weight


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

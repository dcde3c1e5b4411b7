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

from galileo_jax.measurement.segments.blow import SMEARED, continues
from galileo_jax.measurement.segments.rest import is_one_place
from galileo_jax.numerics.least_squares import least_squares
from galileo_jax.observation.observation import Observation, PointPath

HELD, PUSHED, CLEAR = 0.5, 2.0, 4.0
WAY, EARLY = (0.15, 0.7), 0.2  # shares of the length of the way
WINDOW_SHARE, FEWEST = 0.05, 6  # of the frames in motion; frames
PUSHED_WAY = 0.5  # of the way on a level table
LATER = 0.4  # of the windows of what falls or flies: the others tell what is usual
FREE_FRAMES = 20  # on either side of a jump, that tell the acceleration
MEETS = 6.0  # standard deviations: a parabola meets a place from which drag bends the path
MOST_SPREAD = 0.5  # of a_way within the way: what accelerates so unevenly has no usual way


def hand_frame(observation: Observation, least_m_s2: float = 0.0) -> int | None:
    """The first frame in which object 1 is free of the hand that moves it; None: at once.

    By `least_m_s2` the board alone may speed it up, as long as drag does not slow it.
    """
    path = observation.path()
    if len(path) < 4 * FEWEST:
        return None
    gone, length = _gone(path.place_m)
    began = _leaves(path, gone, length)
    size = _window(len(path) - began)
    if began == 0 or len(path) - began < 4 * size:
        return None  # it moves when it is first seen: whoever let it go is not in the clip
    starts = np.arange(began, len(path) - size)
    found, sd = _accelerations(path, gone, starts, size)
    middle = gone[starts + size // 2] / length
    on_way = (middle > WAY[0]) & (middle < WAY[1])
    if on_way.sum() < size:
        return None
    low, usual, high = np.quantile(found[on_way], [0.25, 0.5, 0.75])
    if usual <= 0 or high - low > MOST_SPREAD * usual:
        return None
    is_held = (found < HELD * usual) | (found > max(PUSHED * usual, least_m_s2))
    is_held &= (np.abs(found - usual) > CLEAR * sd) & (middle < EARLY)
    return int(path.frames[starts[is_held][-1] + size]) if is_held.any() else None


def goes_up(observation: Observation) -> bool:
    """Whether object 1 goes up its board first, against `Clip.direction`."""
    path = observation.path()
    return bool(len(path) and path.gone_m[0, path.farthest] < 0)


def pushed_frame(observation: Observation, index: int = 0, least_m_s2: float = 0.0) -> int | None:
    """The first frame after a push on the level, or on a board; None where nothing pushes it first.

    It gains speed, by `CLEAR` standard deviations of its acceleration in a window and by `HELD` of
    what friction slows it down by, within the first half of its way only: what gains speed for
    longer is pulled by something of the scene. Somewhere it does so by more than `least_m_s2`,
    which is what the scene itself may speed it up by.
    """
    path = observation.path(index)
    if len(path) < 4 * FEWEST:
        return None
    gone, length = _gone(path.place_m)
    size = _window(len(path))
    starts = np.arange(len(path) - size + 1)
    found, sd = _accelerations(path, gone, starts, size)
    middle = gone[starts + size // 2] / length
    on_way = (middle > WAY[0]) & (middle < WAY[1])
    slows = -float(np.median(found[on_way])) if on_way.any() else 0.0
    # What rests before the push and after the way scatters by less than what moves.
    # What is thrown back goes backwards first, and gains speed within a single step.
    forward = gone[starts + 1] - gone[starts] > -CLEAR * np.sqrt(2 * np.median(path.variance_m2))
    is_gain = (found > max(CLEAR * sd, HELD * slows)) & forward
    around = np.pad(is_gain, 1)
    gains = np.flatnonzero(is_gain & (around[:-2] | around[2:]))
    if not gains.size or middle[gains[-1]] > PUSHED_WAY:
        return None
    if not (found[gains] > least_m_s2 + CLEAR * sd).any():
        return None
    return int(path.frames[min(gains[-1] + size, len(path) - 1)])


def thrown_frame(
    observation: Observation, rest_belongs: bool, most_m_s2: float = 0.0
) -> int | None:
    """The first frame in which object 1 is free of the hand that throws or drops it; None: at once.

    It may lie still at first, without a hand, where its `rest_belongs` to the motion. Down it may
    speed up by `most_m_s2` without one, until drag slows it.
    """
    path = observation.path()
    if len(path) < 3 * FEWEST:
        return None
    if rest_belongs:
        path = path[_begins(path)[0] :]
    size, held, is_carried = _window(len(path)), -1, False
    while 3 * size <= len(path):
        held, is_carried, is_clear = _last_held(path, size, most_m_s2)
        if held >= 0 or is_clear:
            break
        size *= 2  # so short a window does not tell the acceleration
    first = held + size if held >= 0 else 0
    free = slice(first, min(first + 4 * max(FEWEST, size), len(path)))
    # A drag that changes on the way leads on to what was before it, and a hand that lets go gently.
    own = free if is_carried else None
    while first > 0 and continues(path, first - 1, own or slice(first, free.stop), MEETS):
        first -= 1
    # Within a step of its end a hand's push does not show.
    return int(path.frames[first + 1]) if first else None


def shaken_frame(observation: Observation) -> int | None:
    """The first frame in which object 1 falls by itself from a hand that was not still.

    None where it was still, or nothing held it: the mean places of the thirds of the time before
    agree, as those of a rest do.
    """
    path = observation.path()
    free, way_m = _begins(path)
    held = path[: max(free - SMEARED, 0)]
    if len(held) < FEWEST or free + 1 >= len(path):
        return None
    return None if is_one_place(held, way_m) else int(path.frames[free + 1])


def comes_free(observation: Observation, last: int) -> bool:
    """Whether what jumps after the frame `last` is let go there, and falls or flies from then on.

    A bounce has the same acceleration on both sides: its weight's. A hand lifts or holds.
    """
    path = observation.path()
    at = int(np.searchsorted(path.frames, last)) + 1
    parts = path[max(at - FREE_FRAMES, 0) : at], path[at + SMEARED : at + SMEARED + FREE_FRAMES]
    if min(map(len, parts)) < FEWEST:
        return False
    fits = [part.polynomial(2, part.times_s[0]) for part in parts]
    held, free = (2 * fit.solution[0] for fit in fits)
    sds = [2 * float(np.sqrt(np.mean(fit.sds[0] ** 2))) for fit in fits]
    size, apart = float(np.linalg.norm(free)), float(np.linalg.norm(held - free))
    falls = -free[1] > abs(free[0]) and size > CLEAR * sds[1]
    return bool(falls and apart > max(HELD * size, CLEAR * float(np.linalg.norm(sds))))


def _window(frames: int) -> int:
    """How many of the frames in motion tell an acceleration."""
    return max(FEWEST, round(WINDOW_SHARE * frames))


def _begins(path: PointPath) -> tuple[int, float]:
    """The first place from which on it is clearly away from the first; and how far it comes, m."""
    gone = np.linalg.norm(path.gone_m, axis=0)
    way_m = float(gone.max(initial=0.0))
    return _leaves(path, gone, way_m), way_m


def _leaves(path: PointPath, gone_m: np.ndarray, length_m: float) -> int:
    """The first place from which on it is clearly away from where it was."""
    variance = path.variance_m2
    left = gone_m > CLEAR * np.sqrt(variance + variance[0]) + 1e-3 * length_m
    return len(left) - int(np.argmin(np.append(left[::-1], False)))


def _last_held(path: PointPath, size: int, most_m_s2: float) -> tuple[int, bool, bool]:
    """Where the last window with a hand on begins, -1: none; and whether noise lets it show.

    Between these, whether the hand carried it: it fell less than `HELD` as fast as later.
    """
    starts = np.arange(len(path) - size + 1)
    each = [_accelerations(path, one, starts, size) for one in path.place_m]
    found, sd = np.array([one for one, _ in each]), each[0][1]
    velocity = np.gradient(path.place_m, path.times_s, axis=1)[:, starts + size // 2]
    is_later = starts >= LATER * len(starts)
    apart, weight = _beside_free(found, velocity, is_later, sd)
    scatter = max(1.4826 * float(np.median(apart[is_later])), sd)
    clear = max(HELD * weight, CLEAR * scatter, CLEAR * float(np.quantile(apart[is_later], 0.75)))
    usual = np.median(found[:, is_later], axis=1)
    falls_freely = (found[1] < usual[1]) & (found[1] > -most_m_s2)
    held = np.flatnonzero((apart > clear) & ~is_later & ~falls_freely)
    falls = usual @ found[:, held] / max(float(usual @ usual), np.finfo(float).tiny)
    is_carried = held.size and usual[1] < 0 and np.median(falls) < HELD
    last = int(starts[held[-1]]) if held.size else -1
    return last, bool(is_carried), clear == HELD * weight


def _beside_free(
    found: np.ndarray, velocity: np.ndarray, is_later: np.ndarray, sd: float
) -> tuple[np.ndarray, float]:
    """What the later windows' weight, drag and lift leave of each, `[window]`; and the weight.

    Drag is along the velocity and as its square, lift across it and as itself. How large they may
    be is of the size of the weight.
    """
    speed = np.linalg.norm(velocity, axis=0)
    usual = float(np.linalg.norm(np.median(found[:, is_later], axis=1)))
    top = max(float(speed[is_later].max()), 1e-30)
    drag = -speed * velocity / top**2
    lift = np.stack([-velocity[1], velocity[0], *(0 * velocity[2:])]) / top
    axes = [np.broadcast_to(axis[:, None], velocity.shape) for axis in np.eye(len(velocity))]
    columns = np.stack([*axes, drag, lift], axis=-1)  # [axis, window, unknown]
    unknowns = columns.shape[-1]
    held_fast = np.diag([*np.zeros(len(axes)), *(2 * [max(sd / max(usual, 1e-30), 1e-6)])])
    design = np.concatenate([columns[:, is_later].reshape(-1, unknowns), held_fast])
    seen = np.append(found[:, is_later].reshape(-1), np.zeros(unknowns))
    solution = least_squares(design, seen).solution
    weight = float(np.linalg.norm(solution[: len(axes)]))
    return np.linalg.norm(found - columns @ solution, axis=0), weight


def _accelerations(
    path: PointPath, gone: np.ndarray, starts: np.ndarray, size: int
) -> tuple[np.ndarray, float]:
    """The acceleration in each window of `size` frames, `[window]`, and its standard deviation."""
    times_s = path.times_s
    parts = [slice(start, start + size) for start in starts.tolist()]
    found = [2 * np.polyfit(times_s[p] - times_s[p.start], gone[p], 2)[0] for p in parts]
    step_s = np.median(np.diff(times_s))
    sd = np.sqrt(720 * np.median(path.variance_m2) / size) / (size * step_s) ** 2
    return np.array(found), float(sd)


def _gone(place_m: np.ndarray) -> tuple[np.ndarray, float]:
    """How far it is from where it began, towards where it is furthest; and how far that is."""
    away = place_m - np.median(place_m[:, :FEWEST], axis=1, keepdims=True)
    furthest = away[:, int(np.argmax(np.hypot(*away)))]
    length = float(np.hypot(*furthest))
    return furthest @ away / max(length, np.finfo(float).tiny), length

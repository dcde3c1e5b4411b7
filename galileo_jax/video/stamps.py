"""When each picture of a film was taken, and which pictures are not looked at."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

REPEATED, NEAR_FRAMES = 0.2, 5
"""A picture repeats the one before if it differs from it by less than this share of what pictures
differ by shortly before and after; a motion that begins or ends changes on one side."""
LEAST_REPEATS, REPEATED_SHARE = 3, 1 / 8
"""Fewer, or less of the pictures in which something moves, may be the turn of a swing; 24 a second
stored as 30 repeat one in five."""
SUDDEN = 0.6  # of what a picture changes by: those before a repeat, and after it, are so alike
TURN = 0.9  # of it: what changes by less towards a picture, and by more after it, turns there
LEAST_CHANGE_GREY = 4.0  # of a block of pixels; less is noise
FADED = 0.5  # of the usual contrast: paler pictures at either end belong to a fade
# Of the step before: by more the contrast rises on within a fade, be it even or smooth.
RISES_ON = 0.25
AS_DECLARED = 0.02  # a declared rate that is so near the film's confirms the film's own times


@dataclass(frozen=True)
class Clock:
    """When pictures were taken."""

    times_s: Float[np.ndarray, " picture"]  # `[picture]`, the first is 0
    rate: float  # pictures per second; of a film with lost pictures that of the others
    is_even: bool  # whether all pictures lie on an even grid, a whole number of steps apart


def clock_of(stamps_s: Float[np.ndarray, " picture"], tick_s: float) -> Clock:
    """The clock that a film's time stamps show, which increase and are rounded to `tick_s`.

    Stamps that are an even grid but for their rounding are taken as that grid, in which pictures
    may be missing; others as they are.
    """
    steps = np.diff(stamps_s)
    number = np.concatenate([[0.0], np.cumsum(np.maximum(np.rint(steps / np.median(steps)), 1))])
    step_s, start_s = np.polyfit(number, stamps_s, 1)
    if np.abs(stamps_s - (start_s + step_s * number)).max() <= tick_s:
        return Clock(number * step_s, float(1 / step_s), True)
    return Clock(stamps_s - stamps_s[0], float((len(stamps_s) - 1) / np.ptp(stamps_s)), False)


def at_declared_rate(clock: Clock, fps: float) -> tuple[Clock, float]:
    """The clock at a declared rate, and the film's rate that this was compared with.

    A film of 240 pictures a second that is stored as 30 runs eight times faster. Where pictures
    are unevenly spaced a declared rate near the film's only confirms it.
    """
    steps = np.diff(clock.times_s)
    rates = (clock.rate, len(steps) / float(np.sum(steps)), 1 / float(np.median(steps)))
    rate = min(rates, key=lambda one: abs(np.log(fps / one)))
    if not clock.is_even and abs(fps / rate - 1) < AS_DECLARED:
        return clock, rate
    declared = fps * (clock.rate / rate)
    number = clock.times_s * clock.rate
    number = np.rint(number) if clock.is_even else number
    return Clock(number / declared, declared, clock.is_even), rate


def repeats(change: Float[np.ndarray, " picture"]) -> Bool[np.ndarray, " picture"]:
    """Which pictures show once more what the one before shows, though things move.

    `change` is by how many grey levels a picture differs from the one before, where most. Where
    every second, third, ... picture alone is new, that holds for the whole film.
    """
    count = len(change)
    known = np.pad(np.where(np.arange(count) > 0, change, 0.0), NEAR_FRAMES)
    most = np.lib.stride_tricks.sliding_window_view(known, NEAR_FRAMES).max(axis=1)
    least = np.minimum(most[:count], most[NEAR_FRAMES + 1 :])  # before it, and after
    least[[0, -1]] = 0.0
    is_moving = least > LEAST_CHANGE_GREY
    is_repeat = is_moving & (change < REPEATED * least)
    if is_repeat.sum() < max(LEAST_REPEATS, REPEATED_SHARE * is_moving.sum()):
        return is_repeat & _is_sudden(change, is_repeat)
    fresh = np.flatnonzero(is_moving & ~is_repeat)
    apart = np.diff(fresh)
    period = int(apart.min()) if len(apart) else 1
    if period > 1 and (apart % period == 0).all():
        is_repeat = np.arange(count) % period != fresh[0] % period
        is_repeat[0] = False
    return is_repeat


def _is_sudden(
    change: Float[np.ndarray, " picture"], is_repeat: Bool[np.ndarray, " picture"]
) -> Bool[np.ndarray, " picture"]:
    """Whether pictures right before a run of repeats change by much and alike, and those after.

    At the turn of a swing they change less and less, and then more and more, both.
    """
    found, fresh = np.zeros(len(change), bool), np.flatnonzero(~is_repeat)
    for index in np.flatnonzero(is_repeat):
        at = int(np.searchsorted(fresh, index))
        before, after = change[fresh[max(at - 2, 0) : at]], change[fresh[at : at + 2]]
        least = max(SUDDEN * before.max(initial=0.0), change[index] / REPEATED, LEAST_CHANGE_GREY)
        if len(before) == len(after) == 2 and min(before.min(), after.min()) > least:
            found[index] = before[1] > TURN * before[0] or after[0] > TURN * after[1]
    return found


def is_blank(contrast: Float[np.ndarray, " picture"]) -> Bool[np.ndarray, " picture"]:
    """Which pictures at either end are black, blank or faded, by the sd of their grey levels.

    A film that begins (or ends) so fades in for as long as the contrast rises on.
    """
    is_full = np.flatnonzero(contrast >= FADED * np.median(contrast))
    first = _faded_in(contrast, int(is_full[0]))
    last = len(contrast) - 1 - _faded_in(contrast[::-1], len(contrast) - 1 - int(is_full[-1]))
    index = np.arange(len(contrast))
    return (index < first) | (index > last)


def _faded_in(contrast: Float[np.ndarray, " picture"], first: int) -> int:
    """The first picture after a fade, from the first whose contrast is no longer small."""
    rises = np.diff(contrast)
    while 0 < first < len(rises) and rises[first] > RISES_ON * rises[first - 1]:
        first += 1
    return first


def each_times(total: int, kept: int) -> str:
    """That each picture, or row, is there so many times, where that holds; else nothing."""
    return f", each is there {total // kept} times" if total % kept == 0 else ""


def listed(numbers: np.ndarray, most: int = 8) -> str:
    """Numbers of pictures for a line: `3`, `3 to 9`, `1, 2, 4, ...`."""
    if len(numbers) > 2 and len(numbers) == np.ptp(numbers) + 1:
        return f"{numbers[0]} to {numbers[-1]}"
    return ", ".join(str(one) for one in numbers[:most]) + (", ..." if len(numbers) > most else "")

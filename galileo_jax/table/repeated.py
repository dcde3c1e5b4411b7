"""Rows with the same time or a copied place, and times that begin anew: motions in one table."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from galileo_jax.numerics.least_squares import polynomial
from galileo_jax.numerics.runs import stretches
from galileo_jax.table.clock import COMMON_FPS
from galileo_jax.video.stamps import REPEATED_SHARE, each_times, repeats

LEAST_ROWS = 4  # of a motion; after fewer a smaller time is a mistake in the file
MOST_STEPS = 3.0  # from the first row of a motion to its second
ROUNDED = 1.01  # units in the last place between times that were rounded up and down
MANY_DIGITS = 100.0
"""Units in the last place of a step: what moves so far does not stand at one place by chance."""
COPY, PLACE = 0.5, 0.25
"""Of a step: a copied place is farther from where the path leads, and its original is nearer."""
STAND_INS, FAR = frozenset((0.0, -1.0, -99.0, -999.0, -9999.0)), 2.0
"""What programs write where nothing was seen; times the longest other step."""
GOES_ON = 0.75
"""Of a step: a body goes on so far in a row, or it begins, ends or turns there by itself."""


@dataclass(frozen=True)
class Motion:
    """The rows of a table, and what was done to them."""

    clock: Float[np.ndarray, " row"]  # s, or frames
    places: Float[np.ndarray, "object axis row"]  # in any unit
    lines: Int[np.ndarray, " row"]  # of the file
    said: tuple[str, ...] = ()  # one line each

    def rows(self, which: np.ndarray, *said: str) -> "Motion":
        """Some of them."""
        found = self.clock[which], self.places[..., which], self.lines[which]
        return Motion(*found, (*self.said, *said))

    def unseen_but(self, places: np.ndarray, why: str) -> "Motion":
        """With NaN for some places, and a line that lists their rows and says why."""
        is_less = (np.isnan(places) & np.isfinite(self.places)).any(axis=(0, 1))
        lines = self.lines[is_less]
        if not lines.size:
            return self
        more = f" and {lines.size - 5} more" if lines.size > 5 else ""
        listed = ", ".join(f"line {line}" for line in lines[:5]) + more
        said = f"{listed}: {why} as not seen"
        return replace(self, places=places, said=(*self.said, said))


def motion_starts(clock: np.ndarray) -> tuple[int, ...]:
    """The rows at which motions begin: the first, and those where a clock falls back to its start.

    The first alone where a time goes back in any other way, which is for others to refuse.
    """
    starts = [0, *(1 + np.flatnonzero(np.diff(clock) < 0)).tolist()]
    ends = [*starts[1:], len(clock)]
    begin = np.array(starts)
    if (np.array(ends) - begin < LEAST_ROWS).any():
        return (0,)
    step = float(np.median(np.abs(np.diff(clock))))
    is_back = np.abs(clock[begin] - clock[0]) <= step
    goes_on = clock[begin + 1] - clock[begin] <= MOST_STEPS * step
    return tuple(starts) if is_back.all() and goes_on.all() else (0,)


def unrounded(motion: Motion, resolution_s: float) -> Motion:
    """With even steps for times that are printed more coarsely than rows follow each other.

    Where most of the rows at one time have other places, and even steps agree with all the times to
    the last place that is printed, these steps are used: those of a usual frame rate if they do.
    """
    times = motion.clock
    is_repeat = np.diff(times) == 0
    goes_on = (np.diff(motion.places, axis=-1) != 0).any(axis=(0, 1))
    if times.size < LEAST_ROWS or not is_repeat.any() or goes_on[is_repeat].mean() < 0.5:
        return motion
    rows = np.arange(times.size)
    told = float(np.polyfit(rows, times, 1)[0])
    usual = min((1 / fps for fps in COMMON_FPS), key=lambda step: abs(step - told))
    agree = (
        each for each in (usual, told) if np.ptp(times - each * rows) <= ROUNDED * resolution_s
    )
    if (step := next(agree, 0.0)) <= 0:
        return motion
    said = (
        f"times in steps of {resolution_s:g} s stand in several rows; even steps of "
        f"{step:.3g} s agree with all of them and are used"
    )
    return replace(motion, clock=step * rows, said=(*motion.said, said))


def without_repeats(motion: Motion) -> Motion:
    """Each time once.

    Rows that follow each other at one time count once where they are equal, else as their mean.
    """
    times, places = motion.clock, motion.places
    if times.size < 2 or not (np.diff(times) == 0).any():
        return motion
    is_first = np.concatenate([[True], np.diff(times) != 0])
    group, starts = np.cumsum(is_first) - 1, np.flatnonzero(is_first)
    seen = np.isfinite(places)
    total = np.add.reduceat(np.where(seen, places, 0.0), starts, axis=-1)
    number = np.add.reduceat(seen, starts, axis=-1)
    mean = np.where(number > 0, total / np.maximum(number, 1), np.nan)
    differs = seen & (places != mean[..., group])
    repeats = np.bincount(group) > 1
    num_mixed = int(np.unique(group[differs.any(axis=(0, 1))]).size)
    first = motion.lines[starts[int(repeats.argmax())]]
    how = (
        f"{num_mixed} of them with other places, of which the mean is used"
        if num_mixed
        else "with the same places, which count once"
    )
    said = f"line {first}: {int(repeats.sum())} times stand in several rows, {how}"
    return replace(motion.rows(starts, said), places=mean)


def not_pasted(motion: Motion) -> Motion:
    """The rows that are in a table for the first time.

    Rows from which the clock has gone back were pasted again where they are rows of before to the
    last digit, until the table ends, the clock goes back once more, or goes on beyond all before.
    """
    clock, places = motion.clock, motion.places
    is_new = np.ones(len(clock), bool)
    starts = (1 + np.flatnonzero(np.diff(clock) < 0)).tolist()
    rows = [row.tobytes() for row in np.vstack([clock, places.reshape(-1, len(clock))]).T + 0.0]
    known, latest = set(rows[: starts[0]] if starts else ()), np.maximum.accumulate(clock)
    for start, stop in pairwise([*starts, len(clock)]):
        end = next((row for row in range(start, stop) if rows[row] not in known), stop)
        is_new[start:end] = end < stop and clock[end] <= latest[start - 1]
        known.update(rows[end:stop])
    if is_new.all():
        return motion
    first, count = motion.lines[is_new.argmin()], np.count_nonzero(~is_new)
    said = f"line {first}: {count} rows are rows of before once more; left out"
    return motion.rows(np.flatnonzero(is_new), said)


def each_place_once(motion: Motion, resolution: Sequence[float]) -> Motion:
    """The rows that show something new; `resolution` is that of each axis.

    Pictures that are in a film twice have the same place in two rows: the rule for such pictures
    (`video.stamps`), with the last place printed for a grey level. Of a few that are found here and
    there `without_copies` knows more.
    """
    steps = np.diff(motion.places / np.reshape(resolution, (-1, 1)), axis=-1)
    change = np.append(0.0, np.nan_to_num(np.linalg.norm(steps, axis=(0, 1))))
    is_same = np.append(False, (steps == 0).all(axis=(0, 1)))
    is_repeat = repeats(change) & is_same
    new, total = np.flatnonzero(~is_repeat), len(change)
    if total - len(new) < REPEATED_SHARE * total:
        return motion
    return motion.rows(
        new,
        f"line {motion.lines[is_repeat.argmax()]}: {total - len(new)} of {total} rows repeat the "
        f"places of the one before{each_times(total, len(new))}: left out, and row numbers count "
        "the others",
    )


def without_copies(motion: Motion, resolution: Sequence[float]) -> Motion:
    """With NaN for places that were copied from a neighbour; the clock rises.

    A program that loses a body writes its last place once more, and one that begins late its first
    place before. In a moving body's track a coordinate that is the same in two rows to the last of
    many digits is such a copy where a parabola through three rows beside them leads to one of the
    two and not to the other. `resolution` is that of each axis.
    """
    found = motion.places.copy()
    for body, axis in np.ndindex(found.shape[:2]):
        values = motion.places[body, axis]
        for pair in stretches(np.diff(values) == 0):
            run = np.arange(pair.start, pair.stop + 1)
            copies = _copies(motion.clock, values, run, MANY_DIGITS * resolution[axis])
            found[body][:, copies] = np.nan
    why = "the place of the row beside it, to the last digit, while it moves: a copy, which counts"
    return motion.unseen_but(found, why)


def without_stand_ins(motion: Motion) -> Motion:
    """With NaN for places where a number stands for "not seen".

    Such a place is 0, -1 or -9999 on all axes, or comes again and again to the last digit, and the
    steps to and from it are longer than any other. At an end alone it may be a rest.
    """
    found, values = motion.places.copy(), set()
    for body, place in enumerate(motion.places):
        seen = np.flatnonzero(np.isfinite(place).all(axis=0))
        steps = np.linalg.norm(np.diff(place[:, seen]), axis=0) / np.diff(seen)
        each, which = np.unique(place[:, seen].T, axis=0, return_inverse=True)
        for value in range(len(each)) if len(seen) >= LEAST_ROWS else ():
            there = which.ravel() == value
            others = steps[~there[1:] & ~there[:-1]]
            is_near = np.append(True, steps <= FAR * others.max(initial=0.0))
            runs = stretches(there)
            if not others.any() or (len(runs) < 2 and not set(each[value]) <= STAND_INS):
                continue
            for run in runs:
                sides = [at for at in (run.start, run.stop) if 0 < at < len(seen)]
                if not is_near[sides].any() and (len(sides) > 1 or len(runs) > 1):
                    found[body][:, seen[run]] = np.nan
                    values.add(", ".join(f"{one:g}" for one in each[value]))
    why = f"{' and '.join(sorted(values))}, far from all other rows, counts"
    return motion.unseen_but(found, why)


def _copies(clock: np.ndarray, values: np.ndarray, run: np.ndarray, least: float) -> np.ndarray:
    """Which of rows that are equal are copies of another of them; none where nothing tells."""
    none, last = run[:0], len(values) - 1
    after, before = run[-1] + np.arange(1, 4), run[0] - np.arange(3, 0, -1)
    if len(run) > 2:
        beside = np.concatenate([before, after])
    else:
        beside = after if after[-1] <= last else before
    if beside[0] < 0 or beside[-1] > last or not np.isfinite(values[beside]).all():
        return none
    fit = polynomial(clock[beside] - clock[run[0]], values[beside], 2)
    at = clock[run] - clock[run[0]]
    off = np.abs(np.polyval(fit.solution, at) - values[run])
    speed = abs(float(np.polyval(np.polyder(fit.solution), at[off.argmin()])))
    steps = np.abs(np.diff(values[beside]))
    step = float(steps[np.diff(beside) == 1].min())
    is_moving = step > least and speed * at[1] > GOES_ON * step
    is_told = is_moving and max(off.min(), np.abs(fit.left).max()) <= PLACE * step
    if not is_told or np.delete(off, off.argmin()).min() < COPY * step:
        return none
    return np.delete(run, off.argmin())

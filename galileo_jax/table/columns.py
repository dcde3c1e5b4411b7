"""Roles of a table's columns: by their titles, and by their numbers where these say nothing.

A column that rises evenly is the time, one of whole numbers in steps of one counts frames, and what
is left are places. Beside x and y a column from 0 to 1, mostly near 1, is how sure the program was.
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import clock_times
from galileo_jax.table.heading import Heading
from galileo_jax.table.numbers import Numbers, is_nothing, is_number, parse_columns
from galileo_jax.table.titles import LENGTHS, RADIANS, SECONDS, Title, is_no_place, is_rate
from galileo_jax.table.track_table import MIN_LIKELIHOOD

PLACES = ("x", "y", "z", "line", "angle")
EVEN_SHARE = 0.02  # of its median step: a clock's steps differ by less, a body's by more
LEAST_TICKS = 8  # steps: fewer may be the same by chance
SURE = 0.9  # the median of a column of likelihoods is higher


@dataclass(frozen=True)
class Columns:
    """Columns with roles, by their place in the grid."""

    heading: Heading
    meanings: tuple[Title, ...]
    numbers: dict[int, Numbers]
    warnings: tuple[str, ...] = ()
    labels: tuple[str, ...] = ()  # what the numbers of a column of objects stand for

    def of(self, role: str) -> list[int]:
        """The places of the columns with a role."""
        return [n for n, one in enumerate(self.meanings) if one.role == role and n in self.numbers]

    def name_of(self, n: int) -> str:
        """What messages call a column; no two are the same."""
        return self.heading.name_of(n)

    def given(self, roles: dict[int, str], *said: str) -> "Columns":
        """With other roles for some, and what is said of it."""
        meanings = (
            replace(one, role=roles.get(n, one.role)) for n, one in enumerate(self.meanings)
        )
        return replace(self, meanings=tuple(meanings), warnings=(*self.warnings, *said))


def with_roles(heading: Heading, fps: float | None) -> Columns:
    """The columns with roles by their titles, or else by their numbers."""
    meanings = list(heading.meanings)
    left = [n for n, one in enumerate(meanings) if not one.role and _may_be_used(heading, n)]
    if len(left) == 1 and not any(one.role in PLACES for one in meanings):
        alone = meanings[left[0]]
        meanings[left[0]] = replace(alone, role="angle" if alone.unit in RADIANS else "line")
    has_clock = any(one.role in ("time", "frame") for one in meanings)
    has_place = any(one.role in PLACES for one in meanings)
    asked = [n for n, one in enumerate(meanings)
             if (one.role and not (one.role in ("object", "frame") and _are_words(heading, n)))
             or (n in left and not (has_clock and has_place))]  # fmt: skip
    # Whatever it is called, a column of dates or of clocks is the time where no other is.
    tried = (
        asked if has_clock else sorted({*asked, *(n for n, m in enumerate(meanings) if not m.role)})
    )
    clocks = {n: clock_times(heading.body, heading.name_of(n), n, fps) for n in tried}
    clocks = {n: clock for n, clock in clocks.items() if clock is not None}
    for n in clocks:
        meanings[n] = replace(meanings[n], role="time", unit="s")
    numbers = _parsed(heading, [n for n in asked if n not in clocks]) | clocks
    columns = Columns(heading, tuple(meanings), numbers)
    if not has_clock and not clocks:
        columns = _with_clock(columns)
    # What was called a place, or was the only column, may have turned out to be the time.
    if not any(one.role in PLACES for one in columns.meanings):
        columns = _with_places(columns)
    columns = _without_counted_time(_swapped_back(_with_other_axis(columns)))
    return _with_labels(_with_likelihoods(columns))


def _parsed(heading: Heading, which: list[int]) -> dict[int, Numbers]:
    named = {heading.name_of(n): n for n in which}
    found = parse_columns(heading.body, named)
    return {n: found[title] for title, n in named.items()}


def _may_be_used(heading: Heading, n: int) -> bool:
    """Whether a column without a known title can be time or place: numbers, in no other unit."""
    title, unit = heading.titles[n], heading.meanings[n].unit
    if is_rate(title) or (unit is None and is_no_place(title)):
        return False
    cells = [row[n] for _, row in heading.body[:200] if n < len(row) and row[n]]
    return bool(cells) and all(is_number(cell) or is_nothing(cell) for cell in cells)


def _are_words(heading: Heading, n: int) -> bool:
    """Whether a column has words alone, as names of bodies, or of files."""
    cells = [row[n] for _, row in heading.body[:200] if n < len(row) and row[n]]
    return bool(cells) and not any(is_number(cell) or is_nothing(cell) for cell in cells)


def _is_even(numbers: Numbers) -> bool:
    """Whether a column rises by the same from row to row, as clocks do."""
    steps = numbers.steps
    if steps.size < 3 or steps.min() <= 0:
        return False
    rounding = 1.01 * (numbers.resolution if math.isfinite(numbers.resolution) else 0.0)
    return bool(np.ptp(steps) <= 2 * max(rounding, EVEN_SHARE * float(np.median(steps))))


def _is_even_as_printed(numbers: Numbers) -> bool:
    """Whether a column rises by the same to the last digit that is printed."""
    steps = numbers.steps
    is_rising = steps.size >= LEAST_TICKS and steps.min() >= 0
    return is_rising and bool(np.ptp(steps) <= 2 * 1.01 * numbers.resolution)


def _ticks(numbers: Numbers) -> bool:
    """Whether a column rises by the same to the last of many digits, as no place does."""
    if not _is_even_as_printed(numbers):
        return False
    return numbers.resolution < EVEN_SHARE * float(np.median(numbers.steps))


def _rises(numbers: Numbers) -> bool:
    """Whether a column rises, and never falls."""
    steps = numbers.steps
    return steps.size > 0 and bool(steps.min() >= 0 and steps.max() > 0)


def _is_rising(numbers: Numbers) -> bool:
    values = numbers.values
    return values.size > 1 and bool((np.diff(values) > 0).all())


def _is_count(numbers: Numbers) -> bool:
    values, steps = numbers.seen, numbers.steps
    is_rising = steps.size > 0 and bool((steps > 0).all())
    return is_rising and bool((values == np.round(values)).all() and np.median(steps) == 1)


def _with_clock(columns: Columns) -> Columns:
    """The columns with one that is the time or counts frames, where the numbers show one."""
    is_titled = columns.heading.is_titled
    roles = {n: columns.meanings[n].role for n in columns.numbers}
    free = [n for n, role in roles.items() if not role or (not is_titled and role in PLACES)]
    timed = [n for n in free if columns.meanings[n].unit in SECONDS and _rises(columns.numbers[n])]
    if timed:
        return columns.given({timed[0]: "time"})
    counts = [n for n in free if _is_count(columns.numbers[n])]
    ticks = [n for n in free if n not in counts and _ticks(columns.numbers[n])]
    if counts:
        # A table that counts its rows may have their times beside it.
        return columns.given({counts[0]: "frame"} | dict.fromkeys(ticks[:1], "time"))
    even = [n for n in free if _is_even(columns.numbers[n])]
    if not even and not is_titled and free and _is_rising(columns.numbers[free[0]]):
        even = free
    return columns.given(dict.fromkeys(even[:1], "time"))


def _with_places(columns: Columns) -> Columns:
    """The columns whose titles say nothing as x and y, or as the way, in their order."""
    free = [n for n in columns.numbers if not columns.meanings[n].role]
    roles = {1: ("line",), 2: ("x", "y"), 3: ("x", "y", "z")}.get(len(free))
    if roles is None:
        titles = [title for title in columns.heading.titles if title]
        shown = ", ".join(repr(title[:40]) for title in titles[:8])
        raise InputError(
            f"which columns are places is not told{f' by {shown}' if shown else ''}; titles such "
            "as t (s), x (m), y (m) expected"
        )
    given = dict(zip(free, roles, strict=True))
    taken = (f"{columns.name_of(n)} as {'the way' if r == 'line' else r}" for n, r in given.items())
    return columns.given(given, f"read by order: {', '.join(taken)}")


def _without_counted_time(columns: Columns) -> Columns:
    """The columns without a time that is the number of the frame again: no rate was known there."""
    times, frames = ([columns.numbers[n].values for n in columns.of(r)] for r in ("time", "frame"))
    is_counted = bool(times and frames) and np.array_equal(times[0], frames[0], equal_nan=True)
    if not is_counted or np.unique(times[0]).size < 3:
        return columns
    return columns.given({columns.of("time")[0]: ""})


def _with_other_axis(columns: Columns) -> Columns:
    """The columns with one of a length, called in words nobody knows, as y beside x, or x beside y.

    Where there is one place alone, and one such column.
    """
    places = [(n, role) for role in PLACES for n in columns.of(role)]
    if len(places) != 1 or places[0][1] not in ("x", "y"):
        return columns
    at, role = places[0]
    unit = columns.meanings[at].unit
    free = [n for n, one in enumerate(columns.meanings)
            if not one.role and unit in LENGTHS and one.unit == unit
            and _may_be_used(columns.heading, n)]  # fmt: skip
    if len(free) != 1:
        return columns
    other, name = "y" if role == "x" else "x", columns.name_of(free[0])
    columns = replace(columns, numbers=columns.numbers | _parsed(columns.heading, free))
    return columns.given(
        {free[0]: other}, f"{name!r} beside {columns.name_of(at)!r} is read as {other}"
    )


def _with_likelihoods(columns: Columns) -> Columns:
    """The columns with those that say how sure a program was of x and y, whatever their title."""
    meanings = columns.meanings
    free = [
        n
        for n in range(2, len(meanings))
        if not meanings[n].role
        and (meanings[n - 2].role, meanings[n - 1].role) == ("x", "y")
        and LENGTHS.get(meanings[n - 1].unit or "px") == "px"
        and _may_be_used(columns.heading, n)
    ]
    if not free or columns.of("likelihood"):
        return columns
    found = _parsed(columns.heading, free)
    if not all(map(_is_sureness, found.values())):
        return columns
    said = (
        f"{columns.name_of(free[0])!r} (0 to 1 beside x and y) is taken for how sure the "
        f"program was; points below {MIN_LIKELIHOOD} count as not seen"
    )
    named = tuple(
        replace(one, role="likelihood", name=meanings[n - 1].name) if n in found else one
        for n, one in enumerate(meanings)
    )
    numbers, warnings = columns.numbers | found, (*columns.warnings, said)
    return replace(columns, meanings=named, numbers=numbers, warnings=warnings)


def _with_labels(columns: Columns) -> Columns:
    """The columns with one of words as that of objects, where these tell rows of one time apart."""
    clock = [n for role in ("time", "frame") for n in columns.of(role)][:1]
    if not clock or columns.of("object"):
        return columns
    times = columns.numbers[clock[0]].values.tolist()
    if len(set(times)) == len(times):
        return columns
    for n in (n for n in range(len(columns.meanings)) if n not in columns.numbers):
        words = [row[n] if n < len(row) else "" for _, row in columns.heading.body]
        labels = list(dict.fromkeys(words))
        if "" in labels or len(labels) < 2 or len(set(zip(words, times, strict=True))) < len(times):
            continue
        numbers = Numbers(np.array([labels.index(word) for word in words], float), math.nan)
        named = columns.given(
            {n: "object"}, f"{columns.name_of(n)!r} tells {len(labels)} objects apart"
        )
        return replace(named, numbers=named.numbers | {n: numbers}, labels=tuple(labels))
    return columns


def _is_sureness(numbers: Numbers) -> bool:
    """Whether numbers lie between 0 and 1, most of them near 1, and are not all the same."""
    seen = numbers.seen
    if seen.size < 3 or seen.min() < 0 or seen.max() > 1 or np.ptp(seen) == 0:
        return False
    return bool(np.median(seen) > SURE)


def _swapped_back(columns: Columns) -> Columns:
    """The columns with the one that rises evenly as the time, where the one called so does not."""
    clock, places = columns.of("time"), [n for role in PLACES for n in columns.of(role)]
    if len(clock) != 1 or columns.of("object"):
        return columns
    called = columns.numbers[clock[0]]
    goes_back = bool((np.nan_to_num(np.diff(called.values), nan=1.0) < 0).any())
    if not goes_back and _is_even_as_printed(called):
        return columns
    is_clock = _is_even if goes_back else _ticks
    steps = {n: columns.numbers[n].steps for n in places if is_clock(columns.numbers[n])}
    if not steps or len(places) > 3:
        return columns
    even = min(sorted(steps), key=lambda n: np.ptp(steps[n]) / np.median(steps[n]))
    roles = sorted((columns.meanings[n].role for n in places), key=PLACES.index)
    rest = sorted(n for n in (*places, clock[0]) if n != even)
    by_column = {even: "time"} | dict(zip(rest, roles, strict=True))
    said = ", ".join(f"{columns.name_of(n)!r} as {role}" for n, role in by_column.items())
    warning = (
        f"{columns.name_of(even)!r} rises evenly by "
        f"{float(np.median(np.diff(columns.numbers[even].values))):g} and "
        f"{columns.name_of(clock[0])!r} {'goes up and down' if goes_back else 'does not'}: titles "
        f"swapped; read {said}"
    )
    return columns.given(by_column, warning)

"""Roles of a table's columns: by their titles, and by their numbers where these say nothing.

A column that rises evenly is the time, one of whole numbers in steps of one counts frames, and what
is left are places. Beside x and y a column from 0 to 1, mostly near 1, is how sure the program was.
"""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import clock_times
from galileo_jax.table.heading import Heading
from galileo_jax.table.numbers import Numbers, is_nothing, is_number, parse_columns
from galileo_jax.table.titles import LENGTHS, Title, is_no_place
from galileo_jax.table.track_table import MIN_LIKELIHOOD

PLACES = ("x", "y", "z", "line", "angle")
EVEN_SHARE = 0.02
"""Of its median step: a clock's steps differ by less, a body's by more."""

LEAST_TICKS = 8
"""Steps: fewer may be the same by chance."""

SURE = 0.9
"""The median of a column of likelihoods is higher."""


@dataclass(frozen=True)
class Columns:
    """Columns with roles, by their place in the grid."""

    meanings: tuple[Title, ...]
    numbers: dict[int, Numbers]
    warnings: tuple[str, ...] = ()

    def of(self, role: str) -> list[int]:
        """The places of the columns with a role."""
        return [n for n, one in enumerate(self.meanings) if one.role == role and n in self.numbers]


def with_roles(path: Path, heading: Heading, fps: float | None) -> Columns:
    """The columns with roles by their titles, or else by their numbers."""
    meanings = heading.meanings
    if not any(one.role in PLACES for one in meanings) and (way := _only_one_left(heading)):
        meanings = tuple(replace(one, role="line") if one is way else one for one in meanings)
    asked = [n for n, one in enumerate(meanings) if one.role]
    has_clock = any(one.role in ("time", "frame") for one in meanings)
    has_place = any(one.role in PLACES for one in meanings)
    if not has_clock or not has_place:
        asked = [n for n, one in enumerate(meanings) if one.role or _may_be_used(heading, n)]
    numbers: dict[int, Numbers] = {}
    clocks = {}
    for n in asked:
        clock = clock_times(path, heading.body, heading.name_of(n), n, fps)
        if clock is not None:
            clocks[n] = clock
    plain = {heading.name_of(n): n for n in asked if n not in clocks}
    parsed = parse_columns(path, heading.body, plain)
    numbers = {n: parsed[title] for title, n in plain.items()} | clocks
    meanings = tuple(
        replace(one, role="time", unit="s") if n in clocks else one
        for n, one in enumerate(meanings)
    )
    columns = Columns(meanings, numbers)
    if not has_clock and not clocks:
        columns = _with_clock(heading, columns)
    if not has_place:
        columns = _with_places(path, heading, columns)
    return _with_likelihoods(path, heading, _swapped_back(path, heading, columns))


def _may_be_used(heading: Heading, n: int) -> bool:
    """Whether a column without a known title can be time or place: numbers, in no other unit."""
    unit = heading.meanings[n].unit
    if unit is None and is_no_place(heading.titles[n]):
        return False
    cells = [row[n] for _, row in heading.body[:200] if n < len(row) and row[n]]
    return bool(cells) and all(is_number(cell) or is_nothing(cell) for cell in cells)


def _only_one_left(heading: Heading) -> Title | None:
    """The only column that may be the way, where one is left; None where none or several are."""
    left = [
        one for n, one in enumerate(heading.meanings) if not one.role and _may_be_used(heading, n)
    ]
    return left[0] if len(left) == 1 else None


def _is_even(numbers: Numbers) -> bool:
    """Whether a column rises by the same from row to row, as clocks do."""
    values = numbers.values[np.isfinite(numbers.values)]
    steps = np.diff(values)
    if steps.size < 3 or steps.min() <= 0:
        return False
    rounding = 1.01 * (numbers.resolution if math.isfinite(numbers.resolution) else 0.0)
    return bool(np.ptp(steps) <= 2 * max(rounding, EVEN_SHARE * float(np.median(steps))))


def _is_even_as_printed(numbers: Numbers) -> bool:
    """Whether a column rises by the same to the last digit that is printed."""
    steps = np.diff(numbers.values[np.isfinite(numbers.values)])
    if steps.size < LEAST_TICKS or steps.min() < 0:
        return False
    return bool(np.ptp(steps) <= 2 * 1.01 * numbers.resolution)


def _ticks(numbers: Numbers) -> bool:
    """Whether a column rises by the same to the last of many digits, as no place does."""
    steps = np.diff(numbers.values[np.isfinite(numbers.values)])
    return _is_even_as_printed(numbers) and numbers.resolution < EVEN_SHARE * np.median(steps)


def _unevenness(numbers: Numbers) -> float:
    """The range of a rising column's steps, over the usual one."""
    steps = np.diff(numbers.values[np.isfinite(numbers.values)])
    return float(np.ptp(steps) / np.median(steps))


def _is_count(numbers: Numbers) -> bool:
    values = numbers.values[np.isfinite(numbers.values)]
    return (
        _is_rising(values)
        and bool((values == np.round(values)).all())
        and bool(np.median(np.diff(values)) == 1)
    )


def _is_rising(values: np.ndarray) -> bool:
    return values.size > 1 and bool((np.diff(values) > 0).all())


def _with_clock(heading: Heading, columns: Columns) -> Columns:
    """The columns with one that is the time or counts frames, where the numbers show one."""
    free = [n for n in columns.numbers if not columns.meanings[n].role
            or (not heading.is_titled and columns.meanings[n].role in PLACES)]  # fmt: skip
    counts = [n for n in free if _is_count(columns.numbers[n])]
    ticks = [n for n in free if n not in counts and _ticks(columns.numbers[n])]
    if counts:
        # A table that counts its rows may have their times beside it.
        return _given(columns, {counts[0]: "frame"} | dict.fromkeys(ticks[:1], "time"))
    if even := [n for n in free if _is_even(columns.numbers[n])]:
        return _given(columns, {even[0]: "time"})
    if not heading.is_titled and free and _is_rising(columns.numbers[free[0]].values):
        return _given(columns, {free[0]: "time"})
    return columns


def _with_places(path: Path, heading: Heading, columns: Columns) -> Columns:
    """The columns whose titles say nothing as x and y, or as the way, in their order."""
    free = [n for n in columns.numbers if not columns.meanings[n].role]
    roles = {1: ("line",), 2: ("x", "y"), 3: ("x", "y", "z")}.get(len(free))
    if roles is None:
        titles = [title for title in heading.titles if title]
        shown = ", ".join(repr(title[:20]) for title in titles[:8]) or "no titles"
        raise InputError(
            f"{path}: which columns are places is not told by {shown}; titles such as t (s), "
            "x (m), y (m) expected"
        )
    columns = _given(columns, dict(zip(free, roles, strict=True)))
    taken = ", ".join(f"{heading.name_of(n)} as {'the way' if r == 'line' else r}"
                      for n, r in zip(free, roles, strict=True))  # fmt: skip
    return replace(columns, warnings=(*columns.warnings, f"{path}: read by order: {taken}"))


def _with_likelihoods(path: Path, heading: Heading, columns: Columns) -> Columns:
    """The columns with those that say how sure a program was of x and y, whatever their title."""
    meanings = columns.meanings
    free = [
        n
        for n, one in enumerate(meanings)
        if n >= 2
        and not one.role
        and (meanings[n - 2].role, meanings[n - 1].role) == ("x", "y")
        and (LENGTHS.get(meanings[n - 1].unit or "px") == "px")
        and _may_be_used(heading, n)
    ]
    if not free or columns.of("likelihood"):
        return columns
    parsed = parse_columns(path, heading.body, {heading.name_of(n): n for n in free})
    found = {n: parsed[heading.name_of(n)] for n in free}
    if not all(_is_sureness(one.values) for one in found.values()):
        return columns
    said = (
        f"{path}: {heading.name_of(free[0])!r} (0 to 1 beside x and y) is taken for how sure the "
        f"program was; points below {MIN_LIKELIHOOD} count as not seen"
    )
    named = tuple(
        replace(one, role="likelihood", name=meanings[n - 1].name) if n in found else one
        for n, one in enumerate(meanings)
    )
    return Columns(named, columns.numbers | found, (*columns.warnings, said))


def _is_sureness(values: np.ndarray) -> bool:
    """Whether numbers lie between 0 and 1, most of them near 1, and are not all the same."""
    seen = values[np.isfinite(values)]
    if seen.size < 3 or seen.min() < 0 or seen.max() > 1 or np.ptp(seen) == 0:
        return False
    return bool(np.median(seen) > SURE)


def _given(columns: Columns, roles: dict[int, str]) -> Columns:
    meanings = [replace(one, role=roles.get(n, one.role)) for n, one in enumerate(columns.meanings)]
    return replace(columns, meanings=tuple(meanings))


def _swapped_back(path: Path, heading: Heading, columns: Columns) -> Columns:
    """The columns with the one that rises evenly as the time, where the one called so does not."""
    clock, places = columns.of("time"), [n for role in PLACES for n in columns.of(role)]
    if len(clock) != 1 or columns.of("object"):
        return columns
    called = columns.numbers[clock[0]]
    goes_back = bool((np.nan_to_num(np.diff(called.values), nan=1.0) < 0).any())
    if not goes_back and _is_even_as_printed(called):
        return columns
    is_clock = _is_even if goes_back else _ticks
    even = sorted(
        (n for n in places if is_clock(columns.numbers[n])),
        key=lambda n: _unevenness(columns.numbers[n]),
    )
    if not even or len(places) > 3:
        return columns
    roles = sorted((columns.meanings[n].role for n in places), key=PLACES.index)
    rest = sorted(n for n in (*places, clock[0]) if n != even[0])
    by_column = {even[0]: "time"} | dict(zip(rest, roles, strict=True))
    said = ", ".join(f"{heading.name_of(n)!r} as {role}" for n, role in by_column.items())
    step = float(np.median(np.diff(columns.numbers[even[0]].values)))
    warning = (
        f"{path}: {heading.name_of(even[0])!r} rises evenly by {step:g} and "
        f"{heading.name_of(clock[0])!r} {'goes up and down' if goes_back else 'does not'}: titles "
        f"swapped; read {said}"
    )
    return replace(_given(columns, by_column), warnings=(*columns.warnings, warning))

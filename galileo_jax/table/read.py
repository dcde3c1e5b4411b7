"""Any table of a motion: bytes to objects, times and places with their resolution.

    bytes -> text -> grid of cells -> titles, units, names -> roles of columns -> numbers -> table

What no title says is told by the numbers: a column that rises evenly is the time, one of whole
numbers in steps of one counts frames, and what is left are places.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import UNIX_MS, clock_times
from galileo_jax.table.grid import read_grid
from galileo_jax.table.heading import Heading, split_heading
from galileo_jax.table.numbers import Numbers, is_nothing, is_number, parse_columns
from galileo_jax.table.pandas_h5 import is_hdf5, read_h5
from galileo_jax.table.repeated import without_repeats
from galileo_jax.table.spreadsheet import is_spreadsheet
from galileo_jax.table.text import content_of
from galileo_jax.table.titles import DERIVED, LENGTHS, RADIANS, SECONDS, Title
from galileo_jax.table.track_table import MIN_LIKELIHOOD, Column, TrackTable
from galileo_jax.table.tracker_trk import is_trk, read_trk

ONLY = "object1"
"""The name of an object whose columns have none."""

PLACES = ("x", "y", "z", "line", "angle")
EVEN_SHARE = 0.02
"""Of its median step: a clock's steps differ by less, a body's by more."""

MOST_OBJECTS = 50


@dataclass(frozen=True)
class _Columns:
    """Columns with roles, by their place in the grid."""

    meanings: tuple[Title, ...]
    numbers: dict[int, Numbers]
    warnings: tuple[str, ...] = ()

    def of(self, role: str) -> list[int]:
        return [n for n, one in enumerate(self.meanings) if one.role == role and n in self.numbers]


def read_table(path: Path, fps: float | None = None) -> TrackTable:
    """A motion from a text table, a spreadsheet, a Tracker project or a pandas file.

    Args:
      path: the file.
      fps: declared frames per second; tells frames of a clock from its hundredths.

    Raises:
      InputError: one line that names the file, the line and cell or the titles, and what would be
        right.
    """
    content = content_of(path)
    if is_hdf5(content):
        return read_h5(path)
    if is_trk(content) and not is_spreadsheet(content):
        return read_trk(path, content)
    heading = split_heading(path, read_grid(path).rows)
    columns = _with_roles(path, heading, fps)
    return _table(path, heading, columns)


def _with_roles(path: Path, heading: Heading, fps: float | None) -> _Columns:
    """The columns with roles by their titles, or else by their numbers."""
    meanings = heading.meanings
    if not any(one.role in PLACES for one in meanings):
        meanings = tuple(one if one.role else replace(one, role="line") for one in meanings
                         ) if _is_one_left(heading) else meanings  # fmt: skip
    asked = [n for n, one in enumerate(meanings) if one.role]
    has_clock = any(one.role in ("time", "frame") for one in meanings)
    has_place = any(one.role in PLACES for one in meanings)
    if not has_clock or not has_place:
        asked = [n for n, one in enumerate(meanings) if one.role or _may_be_used(heading, n)]
    numbers: dict[int, Numbers] = {}
    clocks = {}
    for n in asked:
        clock = clock_times(path, heading.body, _title(heading, n), n, fps)
        if clock is not None:
            clocks[n] = clock
    plain = {_title(heading, n): n for n in asked if n not in clocks}
    parsed = parse_columns(path, heading.body, plain)
    numbers = {n: parsed[title] for title, n in plain.items()} | clocks
    meanings = tuple(
        replace(one, role="time", unit="s") if n in clocks else one
        for n, one in enumerate(meanings)
    )
    columns = _Columns(meanings, numbers)
    if not has_clock and not clocks:
        columns = _with_clock(heading, columns)
    if not has_place:
        columns = _with_places(path, heading, columns)
    return _swapped_back(path, heading, columns)


def _title(heading: Heading, n: int) -> str:
    """What messages call a column; no two are the same."""
    title = heading.titles[n]
    is_alone = title and heading.titles.count(title) == 1
    return title if is_alone else f"{title} (column {n + 1})" if title else f"column {n + 1}"


def _may_be_used(heading: Heading, n: int) -> bool:
    """Whether a column without a known title can be time or place: numbers, in no other unit."""
    unit = heading.meanings[n].unit
    if heading.titles[n] and unit is None and _is_derived(heading.titles[n]):
        return False
    cells = [row[n] for _, row in heading.body[:200] if n < len(row) and row[n]]
    return bool(cells) and all(is_number(cell) or is_nothing(cell) for cell in cells)


def _is_derived(title: str) -> bool:
    return any(word in DERIVED for word in title.lower().replace("_", " ").split())


def _is_one_left(heading: Heading) -> bool:
    left = [
        n for n, one in enumerate(heading.meanings) if not one.role and _may_be_used(heading, n)
    ]
    return len(left) == 1


def _is_even(numbers: Numbers) -> bool:
    """Whether a column rises by the same from row to row, as clocks do."""
    values = numbers.values[np.isfinite(numbers.values)]
    steps = np.diff(values)
    if steps.size < 3 or steps.min() <= 0:
        return False
    rounding = 1.01 * (numbers.resolution if math.isfinite(numbers.resolution) else 0.0)
    return bool(np.ptp(steps) <= 2 * max(rounding, EVEN_SHARE * float(np.median(steps))))


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


def _with_clock(heading: Heading, columns: _Columns) -> _Columns:
    """The columns with one that is the time or counts frames, where the numbers show one."""
    free = [n for n in columns.numbers if not columns.meanings[n].role
            or (not heading.is_titled and columns.meanings[n].role in PLACES)]  # fmt: skip
    for role, is_it in (("frame", _is_count), ("time", _is_even)):
        found = [n for n in free if is_it(columns.numbers[n])]
        if found:
            return _given(columns, {found[0]: role})
    if not heading.is_titled and free and _is_rising(columns.numbers[free[0]].values):
        return _given(columns, {free[0]: "time"})
    return columns


def _with_places(path: Path, heading: Heading, columns: _Columns) -> _Columns:
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
    taken = ", ".join(f"{_title(heading, n)} as {'the way' if r == 'line' else r}"
                      for n, r in zip(free, roles, strict=True))  # fmt: skip
    return replace(columns, warnings=(*columns.warnings, f"{path}: read by order: {taken}"))


def _given(columns: _Columns, roles: dict[int, str]) -> _Columns:
    meanings = [replace(one, role=roles.get(n, one.role)) for n, one in enumerate(columns.meanings)]
    return replace(columns, meanings=tuple(meanings))


def _swapped_back(path: Path, heading: Heading, columns: _Columns) -> _Columns:
    """The columns with the one that rises evenly as the time, where the one called so does not."""
    clock, places = columns.of("time"), [n for role in PLACES for n in columns.of(role)]
    if len(clock) != 1 or columns.of("object"):
        return columns
    steps = np.diff(columns.numbers[clock[0]].values)
    if not (np.nan_to_num(steps, nan=1.0) < 0).any():
        return columns
    even = sorted(
        (n for n in places if _is_even(columns.numbers[n])),
        key=lambda n: _unevenness(columns.numbers[n]),
    )
    if not even or len(places) > 3:
        return columns
    roles = [columns.meanings[n].role for n in sorted(places)]
    rest = sorted(n for n in (*places, clock[0]) if n != even[0])
    by_column = {even[0]: "time"} | dict(zip(rest, roles, strict=True))
    said = ", ".join(f"{_title(heading, n)!r} as {role}" for n, role in by_column.items())
    step = float(np.median(np.diff(columns.numbers[even[0]].values)))
    warning = (
        f"{path}: {_title(heading, even[0])!r} rises evenly by {step:g} and "
        f"{_title(heading, clock[0])!r} goes up and down: titles swapped; read {said}"
    )
    return replace(_given(columns, by_column), warnings=(*columns.warnings, warning))


def _table(path: Path, heading: Heading, columns: _Columns) -> TrackTable:
    lines = [line for line, _ in heading.body]
    times, frames, _unit_s = _clock(path, heading, columns, lines)
    names, axes, places, resolution = _places(path, heading, columns)
    unit = _unit(path, heading, columns)
    warnings = list(columns.warnings)
    if ids := columns.of("object"):
        clock = frames if times is None else times
        if clock is None:
            raise InputError(
                f"{path}: a column of particles needs one of frames or times beside it"
            )
        names, places, clock = _by_object(path, heading, ids[0], columns, clock, places[0])
        times, frames = (clock, None) if times is not None else (None, clock)
    elif times is not None:
        times, places, said = without_repeats(path, times, places, lines)
        warnings += said
    elif frames is not None:
        frames, places, said = without_repeats(path, frames, places, lines)
        warnings += said
    is_seen_by_program = bool(columns.of("likelihood"))
    if is_seen_by_program:
        unit = unit or "px"
    is_counted = times is None and frames is None
    return TrackTable(
        names=names,
        position=places,
        axes=axes,
        times_s=times,
        frames=np.arange(places.shape[-1], dtype=float) if is_counted else frames,
        is_counted=is_counted,
        frame_s=heading.frame_s,
        unit=unit,
        resolution=resolution,
        y_axis="down" if unit == "px" and is_seen_by_program else None,
        columns=tuple(
            Column(
                _title(heading, n),
                one.role if n in columns.numbers else "",
                one.name,
                one.unit if n in columns.numbers else None,
                columns.numbers[n].resolution if n in columns.numbers else math.nan,
            )
            for n, one in enumerate(columns.meanings)
            if heading.titles[n] or n in columns.numbers
        ),
        warnings=tuple(warnings),
    )


def _clock(
    path: Path, heading: Heading, columns: _Columns, lines: Sequence[int]
) -> tuple[np.ndarray | None, np.ndarray | None, float]:
    """(times in s, None, s per unit) or (None, frames, ...), `[row]`; (None, None) without both."""
    role = "time" if columns.of("time") else "frame"
    found = columns.of(role)
    if not found:
        return None, None, 1.0
    values = columns.numbers[found[0]].values
    if np.isnan(values).any():
        at = int(np.isnan(values).argmax())
        raise InputError(
            f"{path}: line {lines[at]}: {_title(heading, found[0])}: empty; a {role} in every row "
            "expected"
        )
    if role == "frame":
        return None, values, 1.0
    written = columns.meanings[found[0]].unit
    if written is not None and written not in SECONDS:
        raise InputError(
            f"{path}: {_title(heading, found[0])}: a time in {written}; s, ms or us expected"
        )
    per_unit = SECONDS[written] if written else 1.0
    if written is None and UNIX_MS[0] < values[0] < UNIX_MS[1]:
        per_unit = 1e-3
    if abs(values[0]) * per_unit > 1e6:  # a date: what is left of its digits begins at 0
        values = values - values[0]
    return values * per_unit, None, per_unit


def _places(
    path: Path, heading: Heading, columns: _Columns
) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray, tuple[float, ...]]:
    """Names, axes, `[object, axis, row]`, and the resolution of each axis."""
    by_name: dict[str, dict[str, int]] = {}
    for role in PLACES:
        for n in columns.of(role):
            of = by_name.setdefault(columns.meanings[n].name, {})
            if role in of:
                raise InputError(
                    f"{path}: {_title(heading, of[role])!r} and {_title(heading, n)!r}: {role} is "
                    "given twice; keep one, or name the objects, such as x 1 and x 2"
                )
            of[role] = n
    for of in by_name.values():
        if "line" in of and "y" in of and "x" not in of:
            of["x"] = of.pop("line")
        if {"x", "y"} & set(of):
            of.pop("line", None)
            of.pop("angle", None)
    first = next(iter(by_name.values()))
    axes = tuple(role for role in PLACES if role in first)
    for name, of in by_name.items():
        missing = next((role for role in axes if role not in of), None) or next(
            (role for role in of if role not in axes), None
        )
        if missing:
            lacking = name if missing not in of else next(iter(by_name))
            raise InputError(
                f"{path}: no column {missing} of {lacking[:40]!r}; all objects have the same ones"
            )
    places = np.array(
        [[columns.numbers[of[role]].values for role in axes] for of in by_name.values()]
    )
    for index, name in enumerate(by_name):
        sure = [n for n in columns.of("likelihood") if columns.meanings[n].name == name]
        if sure:
            likelihood = columns.numbers[sure[0]].values
            places[index][:, ~(likelihood >= MIN_LIKELIHOOD)] = np.nan
    if "angle" in axes:
        unit = columns.meanings[first["angle"]].unit
        if unit not in RADIANS:
            raise InputError(
                f"{path}: {_title(heading, first['angle'])}: an angle without its unit; "
                "write (deg) or (rad) after its title"
            )
        places[:, axes.index("angle")] *= RADIANS[unit]
    places[:, :, np.isnan(places).any(axis=1).all(axis=0)] = np.nan
    resolution = [
        float(np.median([columns.numbers[of[role]].resolution for of in by_name.values()]))
        for role in axes
    ]
    return tuple(name or ONLY for name in by_name), axes, places, tuple(resolution)


def _unit(path: Path, heading: Heading, columns: _Columns) -> str | None:
    """The unit of length; None where no title has one."""
    written = {
        columns.meanings[n].unit for role in ("x", "y", "z", "line") for n in columns.of(role)
    }
    known = {LENGTHS.get(unit, unit) if unit else None for unit in written}
    if len(known) > 1:
        raise InputError(
            f"{path}: the columns x and y are in different units: "
            f"{', '.join(sorted(unit or 'none' for unit in known))}"
        )
    unit = known.pop() if known else None
    if unit is not None and unit not in LENGTHS.values():
        raise InputError(
            f"{path}: places in {unit}; {', '.join(sorted(set(LENGTHS.values())))} expected"
        )
    return unit


def _by_object(
    path: Path,
    heading: Heading,
    at: int,
    columns: _Columns,
    clock: np.ndarray,
    places: np.ndarray,
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """A table with a row for each object and frame as one with a row for each frame."""
    ids, which = np.unique(columns.numbers[at].values, return_inverse=True)
    if len(ids) > MOST_OBJECTS:
        raise InputError(
            f"{path}: {_title(heading, at)}: {len(ids)} particles; keep the rows of those that are "
            f"meant, at most {MOST_OBJECTS}"
        )
    times, row = np.unique(clock, return_inverse=True)
    found = np.full((len(ids), len(places), len(times)), np.nan)
    found[which, :, row] = places.T
    if len(set(zip(which.tolist(), row.tolist(), strict=True))) < len(row):
        raise InputError(
            f"{path}: {_title(heading, at)}: the same particle twice at one time; one row for each "
            "particle and frame expected"
        )
    return tuple(f"{one:g}" for one in ids), found, times

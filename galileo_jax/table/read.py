"""Any table of a motion: bytes to objects, times and places with their resolution.

bytes -> text -> grid of cells -> titles, units, names -> roles of columns -> numbers -> table
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.table.clock import UNIX_MS
from galileo_jax.table.columns import PLACES, Columns, with_roles
from galileo_jax.table.grid import read_grid
from galileo_jax.table.heading import Heading, split_heading
from galileo_jax.table.pandas_h5 import is_hdf5, read_h5
from galileo_jax.table.repeated import (
    motion_starts,
    not_pasted,
    unrounded,
    without_copies,
    without_repeats,
)
from galileo_jax.table.spreadsheet import is_spreadsheet
from galileo_jax.table.text import content_of
from galileo_jax.table.titles import LENGTHS, RADIANS, SECONDS
from galileo_jax.table.track_table import MIN_LIKELIHOOD, Column, TrackTable
from galileo_jax.table.tracker_trk import is_trk, read_trk

ONLY = "object1"
"""The name of an object whose columns have none."""

MOST_OBJECTS = 50


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
    columns = with_roles(path, heading, fps)
    return _table(path, heading, columns)


def _table(path: Path, heading: Heading, columns: Columns) -> TrackTable:
    lines = [line for line, _ in heading.body]
    times, frames, resolution_s = _clock(path, heading, columns, lines)
    names, axes, places, resolution = _places(path, heading, columns)
    unit = _unit(path, heading, columns)
    warnings, ids = list(columns.warnings), columns.of("object")
    clock = frames if times is None else times
    if clock is not None and not ids:
        new, said = not_pasted(path, clock, places, lines)
        times, frames = (None if one is None else one[new] for one in (times, frames))
        places, lines = places[..., new], [lines[row] for row in new]
        warnings += said
    if ids:
        if clock is None:
            raise InputError(
                f"{path}: a column of particles needs one of frames or times beside it"
            )
        names, places, clock = _by_object(path, heading, ids[0], columns, clock, places[0])
        times, frames = (clock, None) if times is not None else (None, clock)
    elif times is not None:
        if times.size > 1 and (np.diff(times) < 0).all():
            times, places, lines = times[::-1] - times[-1], places[..., ::-1], lines[::-1]
            warnings.append(f"{path}: the last row comes first: read from the end")
        times, even = unrounded(path, times, places, resolution_s)
        times, places, said = without_repeats(path, times, places, lines)
        warnings += [*even, *said]
    elif frames is not None:
        frames, places, said = without_repeats(path, frames, places, lines)
        warnings += said
    is_seen_by_program = bool(columns.of("likelihood"))
    if is_seen_by_program:
        unit = unit or "px"
    is_counted = times is None and frames is None
    frames = np.arange(places.shape[-1], dtype=float) if is_counted else frames
    rows = times if times is not None else frames
    if rows is not None and not ids:
        places, said = without_copies(path, rows, places, resolution, lines)
        warnings += said
    return TrackTable(
        names=names,
        position=places,
        axes=axes,
        times_s=times,
        frames=frames,
        is_counted=is_counted,
        frame_s=heading.frame_s,
        unit=unit,
        resolution=resolution,
        starts=motion_starts(frames if times is None else times),
        y_axis="down" if unit == "px" and is_seen_by_program else None,
        columns=tuple(
            Column(
                heading.name_of(n),
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
    path: Path, heading: Heading, columns: Columns, lines: Sequence[int]
) -> tuple[np.ndarray | None, np.ndarray | None, float]:
    """(times in s, None, their resolution) or (None, frames, 0), `[row]`; neither: both None."""
    role = "time" if columns.of("time") else "frame"
    found = columns.of(role)
    if not found:
        return None, None, 0.0
    values = columns.numbers[found[0]].values
    if np.isnan(values).any():
        at = int(np.isnan(values).argmax())
        raise InputError(
            f"{path}: line {lines[at]}: {heading.name_of(found[0])}: empty; a {role} in every row "
            "expected"
        )
    if role == "frame":
        return None, values, 0.0
    written = columns.meanings[found[0]].unit
    if written is not None and written not in SECONDS:
        raise InputError(
            f"{path}: {heading.name_of(found[0])}: a time in {written}; s, ms or us expected"
        )
    per_unit = SECONDS[written] if written else 1.0
    if written is None and UNIX_MS[0] < values[0] < UNIX_MS[1]:
        per_unit = 1e-3
    if abs(values[0]) * per_unit > 1e6:  # a date: what is left of its digits begins at 0
        values = values - values[0]
    return values * per_unit, None, columns.numbers[found[0]].resolution * per_unit


def _places(
    path: Path, heading: Heading, columns: Columns
) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray, tuple[float, ...]]:
    """Names, axes, `[object, axis, row]`, and the resolution of each axis."""
    by_name: dict[str, dict[str, int]] = {}
    for role in PLACES:
        for n in columns.of(role):
            of = by_name.setdefault(columns.meanings[n].name, {})
            if role in of:
                raise InputError(
                    f"{path}: {heading.name_of(of[role])!r} and {heading.name_of(n)!r}: {role} is "
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
                f"{path}: {heading.name_of(first['angle'])}: an angle without its unit; "
                "write (deg) or (rad) after its title"
            )
        places[:, axes.index("angle")] *= RADIANS[unit]
    places[:, :, np.isnan(places).any(axis=1).all(axis=0)] = np.nan
    resolution = [
        float(np.median([columns.numbers[of[role]].resolution for of in by_name.values()]))
        for role in axes
    ]
    return tuple(name or ONLY for name in by_name), axes, places, tuple(resolution)


def _unit(path: Path, heading: Heading, columns: Columns) -> str | None:
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
    columns: Columns,
    clock: np.ndarray,
    places: np.ndarray,
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """A table with a row for each object and frame as one with a row for each frame."""
    ids, which = np.unique(columns.numbers[at].values, return_inverse=True)
    if len(ids) > MOST_OBJECTS:
        raise InputError(
            f"{path}: {heading.name_of(at)}: {len(ids)} particles; keep the rows of those that are "
            f"meant, at most {MOST_OBJECTS}"
        )
    times, row = np.unique(clock, return_inverse=True)
    found = np.full((len(ids), len(places), len(times)), np.nan)
    found[which, :, row] = places.T
    if len(set(zip(which.tolist(), row.tolist(), strict=True))) < len(row):
        raise InputError(
            f"{path}: {heading.name_of(at)}: the same particle twice at one time; one row for each "
            "particle and frame expected"
        )
    return tuple(f"{one:g}" for one in ids), found, times

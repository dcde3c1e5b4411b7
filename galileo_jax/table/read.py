"""Any table of a motion: bytes to objects, times and places with their resolution.

bytes -> text -> grid of cells -> titles, units, names -> roles of columns -> numbers -> table
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Literal

import numpy as np

from galileo_jax.runtime.errors import InputError, named
from galileo_jax.table.columns import PLACES, Columns, with_roles
from galileo_jax.table.grid import cells_of
from galileo_jax.table.heading import one_below_the_other, split_heading
from galileo_jax.table.numbers import Numbers
from galileo_jax.table.pandas_h5 import is_hdf5, read_h5
from galileo_jax.table.repeated import (
    Motion,
    each_place_once,
    motion_starts,
    not_pasted,
    unrounded,
    without_copies,
    without_repeats,
    without_stand_ins,
)
from galileo_jax.table.spreadsheet import is_spreadsheet
from galileo_jax.table.text import content_of
from galileo_jax.table.titles import LENGTHS, RADIANS, SECONDS, is_axis, way_up
from galileo_jax.table.track_table import METRES_PER_UNIT, MIN_LIKELIHOOD, Column, TrackTable
from galileo_jax.table.tracker_trk import is_trk, read_trk

ONLY = "object1"  # the name of an object whose columns have none
UNIX = ((1e11, 1e-3), (1e14, 1e-6), (1e17, 1e-9))
"""From how many on, and what each is in seconds: ms, us and ns since 1970, from 1973 on."""

FILM_MS = tuple(1000 / fps for fps in (24.0, 30.0, 60.0, 120.0, 240.0))
"""Between two pictures of a film, ms: nobody measures every 33.3 s or 41.7 s."""

MOST_OBJECTS = 50
CENTRE_OF_MASS = "M"  # ImageJ's XM and YM, of the thing whose middle are X and Y

SAME_CLOCK = 0.01  # of what goes by on one clock: another that is further off is another one


def read_table(path: Path, fps: float | None = None, num_bodies: int = 1) -> TrackTable:
    """A motion from a text table, a spreadsheet, a Tracker project or a pandas file.

    Args:
      path: the file.
      fps: declared frames per second; tells frames of a clock from its hundredths.
      num_bodies: that move; the same columns again are runs of one, or else other bodies.

    Raises:
      InputError: one line that names the file, the line and cell or the titles, and what would be
        right.
    """
    with named(path):
        content = content_of(path)
        if is_hdf5(content):
            table = read_h5(path)
        elif is_trk(content) and not is_spreadsheet(content):
            table = read_trk(content)
        else:
            heading = one_below_the_other(split_heading(cells_of(content)), num_bodies)
            table = _table(with_roles(heading, fps))
    return replace(table, warnings=tuple(f"{path}: {one}" for one in table.warnings))


def _table(columns: Columns) -> TrackTable:
    lines = np.array([line for line, _ in columns.heading.body])
    clock, resolution_s = _clock(columns, lines)
    is_in_frames, is_counted, ids = not columns.of("time"), clock is None, columns.of("object")
    unit = _unit(columns)
    names, axes, places, resolution = _places(columns, unit)
    if ids:
        if clock is None:
            raise InputError("a column of particles needs one of frames or times beside it")
        names, places, clock = _by_object(columns, ids[0], clock, places[0])
    elif clock is None:
        clock = np.arange(places.shape[-1], dtype=float)
    motion = Motion(clock, places, lines, columns.warnings)
    if not ids and not is_counted:
        motion = not_pasted(motion)
        if not is_in_frames:
            motion = unrounded(_forward(columns, motion), resolution_s)
        motion = without_repeats(motion)
    if not ids:
        motion = each_place_once(without_stand_ins(motion), resolution)
        motion = without_copies(motion, resolution)
    is_seen_by_program = bool(columns.of("likelihood"))
    unit = unit or ("px" if is_seen_by_program else None)
    return TrackTable(
        names=names,
        position=motion.places,
        clock=motion.clock,
        is_in_frames=is_in_frames,
        axes=axes,
        is_counted=is_counted,
        frame_s=columns.heading.frame_s,
        unit=unit,
        resolution=resolution,
        starts=motion_starts(motion.clock),
        y_axis=_y_axis(columns, axes, unit == "px" and is_seen_by_program),
        columns=_listed(columns),
        warnings=motion.said,
    )


def _forward(columns: Columns, motion: Motion) -> Motion:
    """The rows in the order of their times, and what is said of these."""
    if _counts_film_ms(columns, columns.of("time")[0]):
        said = "times without a unit are taken as milliseconds, as of a film"
        motion = replace(motion, said=(*motion.said, said))
    count = motion.clock.size
    if count < 2 or not (np.diff(motion.clock) < 0).all():
        return motion
    motion = motion.rows(np.arange(count)[::-1], "the last row comes first: read from the end")
    return replace(motion, clock=motion.clock - motion.clock[0])


def _y_axis(
    columns: Columns, axes: Sequence[str], is_picture: bool
) -> Literal["up", "down"] | None:
    """Which way y points: down in a picture; of one coordinate alone, as its title says."""
    if is_picture or axes != ("y",):
        return "down" if is_picture else None
    return way_up(columns.name_of(columns.of("y")[0]))


def _listed(columns: Columns) -> tuple[Column, ...]:
    found = []
    for n, one in enumerate(columns.meanings):
        title = columns.name_of(n)
        if n in columns.numbers:
            resolution = columns.numbers[n].resolution
            found.append(Column(title, one.role, one.name, one.unit, resolution))
        elif columns.heading.titles[n]:
            found.append(Column(title, "", one.name))
    return tuple(found)


def _clock(columns: Columns, lines: np.ndarray) -> tuple[np.ndarray | None, float]:
    """Times `[row]`, s, and their resolution, or else frames and 0; None of neither."""
    role = "time" if columns.of("time") else "frame"
    _check_one_clock(columns)
    if not (found := columns.of(role)):
        return None, 0.0
    values, title = columns.numbers[found[0]].values, columns.name_of(found[0])
    if np.isnan(values).any():
        at = int(np.isnan(values).argmax())
        raise InputError(f"line {lines[at]}: {title}: empty; a {role} in every row expected")
    if role == "frame":
        return values, 0.0
    written = columns.meanings[found[0]].unit
    if written is not None and written not in SECONDS:
        raise InputError(f"{title}: a time in {written}; s, ms or us expected")
    per_unit = _per_unit(columns, found[0])
    if abs(values[0]) * per_unit > 1e6:  # a date: what is left of its digits begins at 0
        values = values - values[0]
    return values * per_unit, columns.numbers[found[0]].resolution * per_unit


def _per_unit(columns: Columns, n: int) -> float:
    """Seconds in a unit of a column of times."""
    written, first = columns.meanings[n].unit, columns.numbers[n].values[0]
    if written is not None:
        return SECONDS.get(written, math.nan)
    if _counts_film_ms(columns, n):
        return 1e-3
    return next((each for least, each in UNIX[::-1] if first > least), 1.0)


def _counts_film_ms(columns: Columns, n: int) -> bool:
    """Whether times without a unit are those of a film's pictures in milliseconds."""
    values = columns.numbers[n].values
    if columns.meanings[n].unit is not None:
        return False
    step = abs(float(values[-1] - values[0])) / max(len(values) - 1, 1)
    return any(abs(step / one - 1) < SAME_CLOCK for one in FILM_MS)


def _check_one_clock(columns: Columns) -> None:
    """Refuses times, each before places of its own, that go by at different rates."""
    times, places = columns.of("time"), [n for role in PLACES for n in columns.of(role)]
    each = pairwise([*times, len(columns.meanings)])
    clocks = [n for n, end in each if any(n < at < end for at in places)]
    if not clocks and len(places) == 1 and len(times) > 2:  # stopped by hand, again and again
        raise InputError(
            f"{len(times)} times for each place; a table of places, each at a time, expected"
        )
    for first, n in pairwise(clocks):
        one, other = (columns.numbers[at].values * _per_unit(columns, at) for at in (first, n))
        both = np.isfinite(one) & np.isfinite(other)
        gone, there = (float(np.ptp(times[both])) if both.any() else 0.0 for times in (one, other))
        if abs(gone - there) > SAME_CLOCK * gone:
            raise InputError(
                f"{columns.name_of(first)!r} and {columns.name_of(n)!r} are two clocks; a table "
                "for each expected"
            )


def _places(
    columns: Columns, unit: str | None
) -> tuple[tuple[str, ...], tuple[str, ...], np.ndarray, tuple[float, ...]]:
    """Names, axes, `[object, axis, row]` in a unit of length, and the resolution of each axis."""
    by_name = _columns_by_name(columns)
    first_name, first = next(iter(by_name.items()))
    axes = tuple(role for role in PLACES if role in first)
    for name, of in by_name.items():
        lacking = [(role, name) for role in axes if role not in of]
        lacking += [(role, first_name) for role in of if role not in axes]
        for role, who in lacking:
            raise InputError(f"no column {role} of {who[:40]!r}; all objects have the same ones")
    numbers = [[_in_unit(columns, of[role], unit) for role in axes] for of in by_name.values()]
    places = np.array([[one.values for one in row] for row in numbers])
    for index, name in enumerate(by_name):
        sure = (n for n in columns.of("likelihood") if columns.meanings[n].name == name)
        if (n := next(sure, None)) is not None:
            places[index][:, ~(columns.numbers[n].values >= MIN_LIKELIHOOD)] = np.nan
    if "angle" in axes:
        unit = columns.meanings[first["angle"]].unit
        if unit not in RADIANS:
            raise InputError(
                f"{columns.name_of(first['angle'])}: an angle without its unit; "
                "write (deg) or (rad) after its title"
            )
        places[:, axes.index("angle")] *= RADIANS[unit]
    places[:, :, np.isnan(places).any(axis=1).all(axis=0)] = np.nan
    resolution = np.median([[one.resolution for one in row] for row in numbers], axis=0)
    return tuple(name or ONLY for name in by_name), axes, places, tuple(resolution.tolist())


def _columns_by_name(columns: Columns) -> dict[str, dict[str, int]]:
    """By object, and by role, the column of each coordinate."""
    by_name: dict[str, dict[str, int]] = {}
    for role in PLACES:
        for n in columns.of(role):
            of = by_name.setdefault(columns.meanings[n].name, {})
            both = (at for at in (of.get(role), n) if at is not None)
            exact = [at for at in both if is_axis(columns.heading.titles[at])]
            if role in of and len(exact) == 1:  # beside y a height is another thing's, or a box's
                of[role] = exact[0]
                continue
            if role in of:
                raise InputError(
                    f"{columns.name_of(of[role])!r} and {columns.name_of(n)!r}: {role} is "
                    "given twice; keep one, or name the objects, such as x 1 and x 2"
                )
            of[role] = n
    for of in by_name.values():
        if "line" in of and "y" in of and "x" not in of:
            of["x"] = of.pop("line")
        if {"x", "y"} & set(of):
            of.pop("line", None)
            of.pop("angle", None)
    if set(by_name) == {"", CENTRE_OF_MASS}:
        del by_name[CENTRE_OF_MASS]
    every = [role for of in by_name.values() for role in of]
    if len(every) == len(by_name) == len(set(every)):  # words beside x and beside y are no names
        return {"": {role: n for of in by_name.values() for role, n in of.items()}}
    return by_name


def _unit(columns: Columns) -> str | None:
    """The unit of length, of several the first that a title has; None where none has one."""
    places = [n for role in ("x", "y", "z", "line") for n in columns.of(role)]
    written = [columns.meanings[n].unit for n in places]
    known = [LENGTHS.get(unit, unit) if unit else None for unit in written]
    if len(set(known)) > 1 and not METRES_PER_UNIT.keys() >= set(known):
        units = ", ".join(sorted({unit or "none" for unit in known}))
        raise InputError(f"the columns x and y are in different units: {units}")
    unit = known[0] if known else None
    if unit is not None and unit not in LENGTHS.values():
        raise InputError(f"places in {unit}; {', '.join(sorted(set(LENGTHS.values())))} expected")
    return unit


def _in_unit(columns: Columns, n: int, unit: str | None) -> Numbers:
    """A column of places in the unit of all."""
    found, own = columns.numbers[n], LENGTHS.get(columns.meanings[n].unit or "")
    if own == unit or own not in METRES_PER_UNIT or unit not in METRES_PER_UNIT:
        return found
    factor = METRES_PER_UNIT[own] / METRES_PER_UNIT[unit]
    return Numbers(factor * found.values, factor * found.resolution)


def _by_object(
    columns: Columns, at: int, clock: np.ndarray, places: np.ndarray
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray]:
    """A table with a row for each object and frame as one with a row for each frame."""
    ids, which = np.unique(columns.numbers[at].values, return_inverse=True)
    if len(ids) > MOST_OBJECTS:
        raise InputError(
            f"{columns.name_of(at)}: {len(ids)} particles; keep the rows of those that are "
            f"meant, at most {MOST_OBJECTS}"
        )
    times, row = np.unique(clock, return_inverse=True)
    found = np.full((len(ids), len(places), len(times)), np.nan)
    found[which, :, row] = places.T
    if len(set(zip(which.tolist(), row.tolist(), strict=True))) < len(row):
        raise InputError(
            f"{columns.name_of(at)}: the same particle twice at one time; one row for each "
            "particle and frame expected"
        )
    names = (columns.labels[int(one)] if columns.labels else f"{one:g}" for one in ids)
    return tuple(names), found, times

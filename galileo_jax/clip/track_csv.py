"""Tracks in metres as csv: `time_s, object1_x_m, object1_y_m[, object1_sd_m], object2_x_m, ...`.

Axes as in `Observation`: x along the travel, y up, origin at the foot of the ramp. An empty
cell means that the object was not visible. The error of a point is either one standard
deviation for both axes (`object1_sd_m`) or a full covariance (`object1_sd_x_m`,
`object1_sd_y_m`, `object1_correlation`); without either it is estimated from the positions.

A flight in space has `object1_z_m` as well, towards the viewer, and one standard deviation for all
axes (`object1_sd_m`); where times are uncertain, another one along the velocity
(`object1_sd_along_m`). Of a single object the titles may lack its name: `time_s, x_m, y_m, z_m`.

What is seen from above may have `object1_angle_rad` of every object: how far it has turned,
counter-clockwise (with `object1_sd_angle_rad`).

A track that a spreadsheet has saved again is read as well (`table/`).
"""

import csv
import difflib
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from galileo_jax.clip.track_axes import observed_where_finite
from galileo_jax.clip.track_noise import (
    position_noise_m,
    roughness_covariance_m2,
    space_covariance_m2,
    space_noise_m,
    space_sds_m,
)
from galileo_jax.observation.observation import UNMEASURED_SD_M, Observation
from galileo_jax.runtime.atomic_write import write_text
from galileo_jax.runtime.errors import InputError, named
from galileo_jax.table.grid import read_cells
from galileo_jax.table.numbers import Rows, values_of
from galileo_jax.table.read import ONLY

TIME = "time_s"
MIN_ROWS = 4  # three differences: the fewest that show whether a speed changes
MAX_POSITION_M = 2000.0
FAR_M, FAR_ALONE = 100.0, 10.0
"""What is further away, and by so many times further than half of the points, is in other units."""

MAX_SPEED_M_S = 100.0  # nothing that is dropped or thrown is as fast; in millimetres 0.1 m/s is
MAX_SD_RAD = 1.0
MAX_STEP_S = 1.0
"""No motion is seen in frames a second apart; a step of just 1 is a count of frames."""

_ISOTROPIC = ("sd_along_m", "sd_m")
_COVARIANCE = ("sd_x_m", "sd_y_m", "correlation")
_PLACES = ("x_m", "y_m", "z_m")
_FIELDS = ("sd_angle_rad", "angle_rad", *_COVARIANCE, *_ISOTROPIC, *_PLACES)
"""sd_x_m before x_m: the longest ending counts."""

Fields = dict[str, np.ndarray]
"""The columns of one object, each `[row]`."""


def read_observation_csv(path: Path) -> Observation:
    """Reads a csv track in metres.

    Raises `InputError`, one line, naming the file and the column or line that is wrong.
    """
    with named(path):
        return _observation(Path(path))


def _observation(path: Path) -> Observation:
    header, rows = _read_table(path)
    columns = _find_columns(header)
    names = tuple(columns)
    for line, row in rows:
        _check_length(line, row, header, columns)
    table = values_of(rows, {title: at for at, title in enumerate(header)})
    times = table[TIME]
    lines = [f"line {line}" for line, _ in rows]
    check_times(times, lines)
    first = columns[names[0]]
    is_turning = "angle_rad" in first
    axes = ("x_m", "y_m", "angle_rad") if is_turning else _PLACES if "z_m" in first else _PLACES[:2]
    position, covariance = [], []
    for name in names:
        column = {field: table[title] for field, title in columns[name].items()}
        place = _positions(name, np.stack([column[field] for field in axes]), lines)
        check_speed(name, times, place[: 2 if is_turning else 3])
        of = _with_turning if is_turning else _covariance
        covariance.append(of(name, column, times, place, lines))
        position.append(place)
    place, error = np.array(position), np.array(covariance)
    seen = observed_where_finite(names, times, place, error, is_turning)
    is_stated = not {"sd_m", "sd_x_m"}.isdisjoint(first)
    return seen if is_stated else replace(seen, rows_of_noise=len(times))


def write_observation_csv(path: Path, observation: Observation) -> None:
    """Writes a csv track that `read_observation_csv` reads back.

    Positions and times come back to the last digit, covariances to rounding.
    """
    columns = {TIME: observation.times_s}
    for index, name in enumerate(observation.names):
        seen, covariance = observation.mask[index], observation.covariance_m2[index]
        sd = np.sqrt(np.einsum("aat->at", covariance))
        correlation = covariance[0, 1] / (sd[0] * sd[1])
        fields: Fields = dict(zip(_PLACES, observation.position_m[index], strict=False))
        if observation.is_turning:
            fields["angle_rad"] = fields.pop("z_m")
            fields["sd_m"], fields["sd_angle_rad"] = sd[0], sd[2]
        elif len(sd) == 3:
            fields["sd_m"], fields["sd_along_m"] = space_sds_m(covariance)
        elif np.array_equal(sd[0][seen], sd[1][seen]) and not np.any(correlation[seen]):
            fields["sd_m"] = sd[0]
        else:
            fields |= dict(zip(_COVARIANCE, (*sd, correlation), strict=True))
        for field, values in fields.items():
            columns[f"{name}_{field}"] = np.where(seen, values, np.nan)
    write_columns(path, columns, repr)


def write_columns(
    path: Path, columns: Mapping[str, np.ndarray], written: Callable[[float], str]
) -> None:
    """Writes columns `[row]` by their titles, numbers as `written`; what is NaN is left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow("" if math.isnan(value) else written(float(value)) for value in row)
    write_text(path, text.getvalue())


def _read_table(path: Path) -> tuple[list[str], Rows]:
    """The titles and the rows, without the columns and rows that are empty."""
    (_, header), *rows = read_cells(path)
    for line, row in rows:
        for at, (title, cell) in enumerate(zip(header, row, strict=False)):
            if cell and not title:
                raise InputError(
                    f"line {line}: {cell[:40]!r} stands in column {at + 1}, which "
                    "has no title; give it one, such as object1_x_m, or empty the column"
                )
    shown = [at for at, title in enumerate(header) if title]
    rows = [(line, [row[at] for at in shown if at < len(row)] + row[len(header) :])
            for line, row in rows]  # fmt: skip
    return [header[at] for at in shown], rows


def _check_length(
    line: int, row: list[str], header: list[str], columns: dict[str, dict[str, str]]
) -> None:
    """Refuses a row with more cells than titles, or one that is cut off within an object.

    Spreadsheets leave out empty cells at the end of a row: objects that were not visible.
    """
    while len(row) > len(header) and not row[-1]:
        row.pop()
    given, left_out = set(header[: len(row)]), set(header[len(row) :])
    is_cut = any(
        given & set(of.values()) and left_out & set(of.values()) for of in columns.values()
    )
    if len(row) <= len(header) and TIME in given and not is_cut:
        return
    hint = ""
    if len(row) > len(header) and all(cell.lstrip("+-").isdigit() for cell in row if cell):
        hint = "; numbers with a decimal comma need a semicolon between the cells, or a point"
    raise InputError(
        f"line {line}: {len(row)} cells; {len(header)} expected as in the header{hint}"
    )


def _find_columns(header: list[str]) -> dict[str, dict[str, str]]:
    """By object, in their order, the titles of its columns by field."""
    repeated = next((name for name in header if header.count(name) > 1), None)
    if repeated is not None:
        raise InputError(f"column {repeated!r}: given twice; keep one")
    columns: dict[str, dict[str, str]] = {}
    if {"x_m", "y_m"} <= set(header):
        return {ONLY: {title: title for title in header if title in (*_ISOTROPIC, *_PLACES)}}
    for title in header:
        if title == TIME:
            continue
        field = next((f for f in _FIELDS if title.endswith(f"_{f}") and title != f"_{f}"), None)
        if field is None:
            wanted = [TIME, *(f"object{n}_{f}" for n in (1, 2) for f in reversed(_FIELDS))]
            close = difflib.get_close_matches(title, wanted, n=1)
            hint = f"did you mean {close[0]}?" if close else f"known: {', '.join(wanted[:4])}, ..."
            raise InputError(f"column {title[:40]!r}: unknown; {hint}")
        columns.setdefault(title.removesuffix(f"_{field}"), {})[field] = title
    if TIME not in header:
        raise InputError(f"column {TIME!r}: missing")
    if not columns:
        raise InputError("column 'object1_x_m': missing; no object in the header")
    for name, fields in columns.items():
        _check_fields(name, fields, {field for other in columns.values() for field in other})
    return columns


def _check_fields(name: str, fields: dict[str, str], of_any: set[str]) -> None:
    """Refuses an object whose columns do not go together, or are not those of the others."""
    has_covariance = any(field in fields for field in _COVARIANCE)
    in_space, turns = "z_m" in of_any, "angle_rad" in of_any
    if "sd_m" in fields and has_covariance:
        raise InputError(f"column '{name}_sd_m': give it or the covariance, not both")
    if "z_m" in fields and has_covariance:
        raise InputError(f"column '{name}_z_m': in space write '{name}_sd_m', for all axes")
    if turns and (in_space or has_covariance):
        raise InputError(
            f"column '{name}_angle_rad': of what is seen from above, without z_m and "
            f"with '{name}_sd_m' for x and y"
        )
    required = [*_PLACES[: 2 + in_space], *["angle_rad"] * turns, *_COVARIANCE * has_covariance]
    missing = next((field for field in required if field not in fields), None)
    if missing:
        raise InputError(f"column '{name}_{missing}': missing")


def check_times(times: np.ndarray, rows: Sequence[str] | None = None) -> None:
    """Raises `InputError` unless `times` `[row]`, s, are `MIN_ROWS`, increase and are seconds.

    `rows` are what the rows are called in the message; default: row 1, row 2, ...
    """
    if len(times) < MIN_ROWS:
        raise InputError(f"{len(times)} rows; at least {MIN_ROWS} expected")
    rows = rows or [f"row {n + 1}" for n in range(len(times))]
    if np.isnan(times).any():
        raise InputError(f"{rows[int(np.isnan(times).argmax())]}: {TIME}: empty; seconds expected")
    steps = np.diff(times)
    if (steps <= 0).any():
        at = int((steps <= 0).argmax()) + 1
        raise InputError(
            f"{rows[at]}: {TIME}: {times[at]:g} is not after {times[at - 1]:g}; times must increase"
        )
    if np.median(steps) >= MAX_STEP_S:
        raise InputError(
            f"{TIME}: rows are {np.median(steps):g} s apart; seconds expected, "
            f"less than {MAX_STEP_S:g} apart; are these milliseconds or frame numbers (divide them "
            "by 1000 or by the frame rate)?"
        )


def _positions(name: str, position: np.ndarray, lines: Sequence[str]) -> np.ndarray:
    """Places `[axis, row]` that can be metres, or `InputError`."""
    empty = np.isnan(position)
    if (partly := empty.any(axis=0) & ~empty.all(axis=0)).any():
        which = "only one of x and y is" if len(position) == 2 else "not all of x, y and z are"
        raise InputError(f"{lines[int(partly.argmax())]}: {name}: {which} given")
    if (count := int((~empty[0]).sum())) < MIN_ROWS:
        raise InputError(f"{name}: visible in {count} rows; at least {MIN_ROWS} expected")
    largest = float(np.nanmax(np.abs(position)))
    usual = float(np.nanmedian(np.abs(position).max(axis=0)))
    if largest > MAX_POSITION_M or (largest > FAR_M and largest > FAR_ALONE * usual):
        raise InputError(
            f"{name}: a position of {largest:g} m; metres expected; are these pixels or "
            "millimetres?"
        )
    return position


def check_speed(name: str, times: np.ndarray, position: np.ndarray) -> None:
    """Refuses a track that is much too fast over several tenths of it: lengths in other units."""
    seen = np.flatnonzero(np.isfinite(position[0]))
    step = max(len(seen) // 10, 2)
    if len(seen) <= step:
        return
    way = np.linalg.norm(position[:, seen[step:]] - position[:, seen[:-step]], axis=0)
    speed = way / (times[seen[step:]] - times[seen[:-step]])
    usual = float(np.quantile(speed, 0.8))
    if usual > MAX_SPEED_M_S:
        raise InputError(
            f"{name}: moves at {usual:.3g} m/s; metres and seconds expected; if these places are "
            "in centimetres, millimetres or pixels, say so: track_units: cm, mm or px"
        )


def _with_turning(
    name: str, column: Fields, times: np.ndarray, position: np.ndarray, lines: Sequence[str]
) -> np.ndarray:
    """`[3, 3, row]` of x, y (m^2) and the turning (rad^2), which is made continuous in place."""
    seen = np.isfinite(position[2])
    position[2, seen] = np.unwrap(position[2, seen])
    found = np.zeros((3, 3, len(times)))
    found[:2, :2] = _covariance(name, column, times, position[:2], lines)
    given = column.get("sd_angle_rad")
    sd = np.full(len(times), position_noise_m(times, position[2])) if given is None else given
    if not ((sd > 0) & (sd <= MAX_SD_RAD))[seen].all():
        raise InputError(
            f"{name}: standard deviation {sd[seen].max():g} rad of its turning; more than "
            f"0 and at most {MAX_SD_RAD:g} expected; are these degrees?"
        )
    found[2, 2] = sd**2
    return found


def _covariance(
    name: str, column: Fields, times: np.ndarray, position: np.ndarray, lines: Sequence[str]
) -> np.ndarray:
    """`[axis, axis, row]`, m^2, from the columns or else from the positions' roughness."""
    correlation = np.zeros(len(times))
    if "sd_along_m" in column:
        return space_covariance_m2(times, position, column["sd_m"], column["sd_along_m"])
    if "sd_m" in column:
        sd = np.stack([column["sd_m"]] * len(position))
    elif "sd_x_m" in column:
        sd = np.stack([column["sd_x_m"], column["sd_y_m"]])
        correlation = column["correlation"]
    elif len(position) == 3:
        return space_covariance_m2(times, position, *space_noise_m(name, times, position))
    else:
        return roughness_covariance_m2(name, times, position)
    is_visible = np.isfinite(position[0])
    is_right = (
        (sd > 0).all(axis=0) & (sd <= UNMEASURED_SD_M).all(axis=0) & (np.abs(correlation) < 1)
    )
    if not is_right[is_visible].all():
        at = int((is_visible & ~is_right).argmax())
        raise InputError(
            f"{lines[at]}: {name}: standard deviation {sd[0, at]:g} m; more than 0 and at "
            f"most {UNMEASURED_SD_M:g} expected, correlation between -1 and 1"
        )
    covariance = np.einsum("at,ab->abt", sd**2, np.eye(len(sd)))
    covariance[0, 1] = covariance[1, 0] = correlation * sd[0] * sd[1]
    return covariance

"""A track file (our own csv or any table) to an observation in metres.

What is declared counts first, then what the file says, then what the motion shows. What none of
them tells is asked for: one line names the yaml key and its possible values.
"""

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from galileo_jax.clip.declared_track import DeclaredTrack, declared_table
from galileo_jax.clip.fields import MAX_SCALE_PX_PER_M, MIN_SCALE_PX_PER_M, short
from galileo_jax.clip.lost_frames import lost_text, with_lost_frames
from galileo_jax.clip.schema import ClipFile
from galileo_jax.clip.track_axes import (
    along_line,
    check_falls_down,
    goes_right,
    in_plane,
    observed_where_finite,
    rises_or_sinks,
    swung,
    up_from_motion,
)
from galileo_jax.clip.track_csv import (
    MAX_POSITION_M,
    MIN_ROWS,
    check_speed,
    check_times,
    read_observation_csv,
)
from galileo_jax.clip.track_noise import roughness_covariance_m2
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError, named
from galileo_jax.table.clock import usual_step
from galileo_jax.table.grid import cells_of
from galileo_jax.table.pandas_h5 import is_hdf5
from galileo_jax.table.spreadsheet import is_spreadsheet
from galileo_jax.table.text import content_of
from galileo_jax.table.track_table import METRES_PER_UNIT, Calibration, TrackTable
from galileo_jax.table.tracker_trk import is_trk
from galileo_jax.video.stamps import AS_DECLARED, Clock, at_declared_rate

OWN_CSV_SAYS = {
    "track_units": "m",
    "track_y": "up",
    "track_origin": (0.0, 0.0),
    "direction": "right",
}
"""What the titles and axes of our own csv say already; a yaml can only repeat it."""


@dataclass(frozen=True)
class FileTrack:
    """What was read."""

    observation: Observation  # in metres, axes as `Observation` has them
    unit: str  # of the file: "m", "cm", ..., or "px"
    fps: float  # frames per second
    is_own: bool = False  # our own csv, whose titles and axes are fixed
    # of a file in pixels; None = unknown (lengths are in nominal metres)
    pixels_per_metre: float | None = None
    origin_px: tuple[float, float] | None = None  # of a file in pixels; None = unknown
    direction: str = "right"  # of the travel
    warnings: tuple[str, ...] = ()  # doubts, one line each


def read_track(yaml_path: Path, path: Path, file: ClipFile, fps: float | None) -> FileTrack:
    """Reads a track file; the arguments are those of `DeclaredTrack`.

    Raises:
      InputError: one line naming the file and the place that is wrong, or the key that has to
        be given.
    """
    of = DeclaredTrack(yaml_path, path, file, fps)
    is_one_table = file.trial is None and not any(item.track_file for item in file.objects)
    found = _own(of) if is_one_table and _is_ours(path) else _foreign(of)
    check_falls_down(of, found.observation)
    return found


def _own(of: DeclaredTrack) -> FileTrack:
    """Our own csv, in metres along our axes."""
    for key, said in OWN_CSV_SAYS.items():  # a run's yaml repeats what it says
        if (given := getattr(of.file, key)) not in (None, said):
            found = list(given) if isinstance(given, tuple) else given
            raise of.wrong_key(
                f"{key}: {short(found)} means nothing for {of.path.name}, whose columns "
                "are in metres, x along the travel, y up, from the foot of the ramp; leave it out, "
                "and correct the columns if they are not"
            )
    observation = read_observation_csv(of.path)
    third = observation.position_m.shape[1] == 3
    if of.file.track_up == "z":
        if not third:
            raise of.wrong_key(f"track_up: z, but {of.path.name} has no column z_m")
        observation = _turned_up(observation)
    if of.names != observation.names:
        raise of.wrong_key(
            f"objects: {', '.join(of.names)} declared, but {of.path.name} has "
            f"{', '.join(observation.names)}; the same names in the same order expected"
        )
    is_level, is_turning = of.scenario.is_level, observation.is_turning
    in_space = of.scenario.moves_in_plane and not is_level
    if third and not (is_level if is_turning else in_space):
        column = "angle_rad" if is_turning else "z_m"
        raise of.wrong(
            f"column '{column}': means nothing in scenario {of.file.scenario}; leave it out"
        )
    return FileTrack(observation, "m", 1 / usual_step(observation.times_s), is_own=True)


def _turned_up(observation: Observation) -> Observation:
    """From x, y and z up to x, y up and z."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return replace(
        observation,
        position_m=np.einsum("ab,obt->oat", turn, observation.position_m),
        covariance_m2=np.einsum("ab,obct,dc->oadt", turn, observation.covariance_m2, turn),
    )


def _foreign(of: DeclaredTrack) -> FileTrack:
    """Any other table, in its own units and axes."""
    table, warnings = declared_table(of)
    times = _times(of, table)
    with named(of.path):
        check_times(times)
    times, rescaled = _rescaled(of, table, times)
    unit = _unit_of_length(of, table)
    is_px, calibration = unit == "px", table.calibration
    scale = _scale_of(of, calibration) if is_px else None
    origin = (of.file.origin_px or (calibration and calibration.origin_px)) if is_px else None
    metres = 1 / (scale or NOMINAL_SCALE_PX_PER_M) if is_px else METRES_PER_UNIT[unit]
    seen = np.isfinite(table.position).all(axis=1).any(axis=0)
    moves = np.fmax.reduce(table.position, axis=-1) > np.fmin.reduce(table.position, axis=-1)
    if not seen.any():
        raise of.wrong("seen in 0 rows: all places are empty, or nan")
    if not moves.any():
        raise of.wrong(
            "nothing moves: all rows have the same place; was the right column exported?"
        )
    first = int(seen.argmax())
    as_read = times[first:] - times[first]
    table = replace(table, position=table.position[..., first:])
    times = with_lost_frames(as_read, table.position)
    lost = lost_text(of.path, as_read, times)
    said: tuple[str, ...] = ()
    direction = of.file.direction
    if table.axes == ("angle",):
        observation = swung(of, times, table.position[:, 0])
    elif len(table.axes) == 1:
        start = table.position[0, 0, 0] if is_px else 0.0
        way = (table.position[:, 0] - start) * metres
        observation, said = along_line(of, table, times, way, _last_place_m(table, metres)[0])
    else:
        table, turned = in_plane(of, table)
        y_axis, told = _y_axis_of(of, table, times, unit)
        direction, moves_to = _direction_of(of, table)
        said = turned + told + moves_to
        foot = origin if is_px else of.file.track_origin or (0.0, 0.0)
        position = _placed(table, metres, foot, y_axis, direction)
        last_place = _last_place_m(table, metres)
        with named(of.path):
            observation = _observation(of.names, times, position, last_place, is_px and not scale)
    return FileTrack(
        observation,
        unit,
        fps=1 / table.frame_s_by(of.fps) if table.is_in_frames else 1 / usual_step(times),
        pixels_per_metre=scale,
        origin_px=origin,
        direction=direction,
        warnings=table.warnings + warnings + rescaled + lost + said + _doubts(of, table),
    )


def _unit_of_length(of: DeclaredTrack, table: TrackTable) -> str:
    """The unit of length: what is declared, else what the file says."""
    if table.axes == ("angle",):
        return "m"
    by_scale = "px" if of.file.pixels_per_metre is not None else None
    unit = "px" if table.unit == "px" else of.file.track_units or table.unit or by_scale
    if unit is None:
        raise of.wrong_key(
            f"track_units: missing; {of.path.name} does not state its unit of length; "
            f"write track_units: {' | '.join((*METRES_PER_UNIT, 'px'))} (or give it to galileo "
            "label)"
        )
    return unit


def _scale_of(of: DeclaredTrack, calibration: Calibration | None) -> float | None:
    """Pixels per metre: declared, or else the file's; None = unknown."""
    if of.file.pixels_per_metre is not None:
        return of.file.pixels_per_metre
    if calibration is None or not math.isfinite(calibration.pixels_per_unit[0]):
        return None
    per_unit, unit = calibration.pixels_per_unit[0], calibration.unit or of.file.track_units
    if unit not in METRES_PER_UNIT:
        raise of.wrong_key(
            f"track_units: missing; {of.path.name} was calibrated with "
            f"{per_unit:.5g} pixels per unit and does not name the unit; "
            f"write track_units: {' | '.join(METRES_PER_UNIT)}"
        )
    scale = per_unit / METRES_PER_UNIT[unit]
    if not MIN_SCALE_PX_PER_M <= scale <= MAX_SCALE_PX_PER_M:
        raise of.wrong(
            f"calibrated to {scale:.4g} pixels per metre; {MIN_SCALE_PX_PER_M:g} to "
            f"{MAX_SCALE_PX_PER_M:g} expected; correct its calibration or give pixels_per_metre"
        )
    return scale


def _y_axis_of(
    of: DeclaredTrack, table: TrackTable, times: np.ndarray, unit: str
) -> tuple[str, tuple[str, ...]]:
    """Which way y points: as declared, as the file says, as the motion shows."""
    if (declared := of.file.track_y or table.y_axis) is not None:
        return declared, ()
    shows, place = of.scenario.up_shows, table.position[0]
    usual = "down" if unit == "px" else "up"
    found = usual if shows is None else up_from_motion(shows, times, place)
    # What falls along x `check_falls_down` tells; of a path along the other axis up is the same.
    falls_aside = shows == "bend" and up_from_motion("bend", times, place[::-1]) is not None
    is_level = shows == "drop" and np.nanstd(place[1]) == 0
    if found == usual or (found is None and (falls_aside or is_level)):
        return usual, ()
    if shows == "sink":
        raise of.wrong_key(rises_or_sinks(of, "y", usual))
    if found is None:
        raise of.wrong_key(
            f"track_y: missing; {of.path.name} does not state which way its y axis "
            "points, and the motion does not show it; write track_y: up | down"
        )
    return found, (f"{of.path}: track_y: {found}, as the motion shows; declare it if it is not",)


def _direction_of(of: DeclaredTrack, table: TrackTable) -> tuple[str, tuple[str, ...]]:
    """Which way object 1 goes along x: as declared, on a ramp as the motion shows."""
    declared = of.file.direction
    if "direction" in of.file.model_fields_set or not of.scenario.has_ramp:
        return declared, ()
    x = table.position[0, 0][np.isfinite(table.position[0]).all(axis=0)]
    found = "right" if not x.size or goes_right(x) else "left"
    if found == declared:
        return declared, ()
    return found, (f"{of.path}: direction: {found}, as the motion shows; declare it if it is not",)


def _placed(
    table: TrackTable,
    metres: float,
    origin: tuple[float, float] | None,
    y_axis: str,
    direction: str,
) -> np.ndarray:
    """`[object, 2, row]`, m, x along the travel, y up; from object 1 without an origin."""
    position, calibration = table.position, table.calibration
    if origin is None:
        seen = np.flatnonzero(np.isfinite(position[0]).all(axis=0))
        origin = tuple(position[0, :, seen[0]]) if seen.size else (0.0, 0.0)
    x, y = position[:, 0] - origin[0], position[:, 1] - origin[1]
    y = -y if y_axis == "down" else y
    if calibration is not None:
        if math.isfinite(calibration.pixels_per_unit[0]):
            y = y * calibration.pixels_per_unit[0] / calibration.pixels_per_unit[1]
        cos, sin = math.cos(calibration.roll_rad), math.sin(calibration.roll_rad)
        x, y = cos * x + sin * y, cos * y - sin * x
    found = np.stack([x if direction == "right" else -x, y], axis=1) * metres
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.nan)


OURS = re.compile(r"time_s|\w+_[xy]_m", re.IGNORECASE)
OUR_BODY = re.compile(r"object\d+(_\w+)?|(\w+_)?[xyz]_m", re.IGNORECASE)


def _is_ours(path: Path) -> bool:
    """Whether it is the csv that `track` writes, or was meant as one, with x and y."""
    with named(path):
        content = content_of(path)
        if is_hdf5(content) or is_spreadsheet(content) or is_trk(content):
            return False
        head = [line for line in content[:65_536].replace(b"\0", b"").splitlines() if line.strip()]
        if not any(OURS.search(line.decode("ascii", "ignore")) for line in head[:3]):
            return False
        titles = [title.lower() for title in cells_of(content)[0][1]]
    sides = {axis for axis in "xy" for one in titles if f"_{one}".endswith(f"_{axis}_m")}
    is_meant = all(any(map(one.fullmatch, titles)) for one in (OURS, OUR_BODY))
    return len(sides) != 1 and is_meant


def _times(of: DeclaredTrack, table: TrackTable) -> np.ndarray:
    """`[row]`, s."""
    if table.is_in_frames and of.fps is None and table.frame_s is None:
        has = "has no times" if table.is_counted else "counts frames"
        raise of.wrong_key(
            f"fps: missing; {of.path.name} {has}; write fps: and the camera's true "
            "frame rate, such as fps: 30.0"
        )
    return table.seconds(of.fps)


def _rescaled(
    of: DeclaredTrack, table: TrackTable, times: np.ndarray
) -> tuple[np.ndarray, tuple[str, ...]]:
    """The times of a table that has some, at the declared rate, and what is said of that."""
    if table.is_in_frames or of.fps is None:
        return times, ()
    clock, rate = at_declared_rate(Clock(times, 1 / usual_step(times), False), of.fps)
    if abs(of.fps / rate - 1) < AS_DECLARED:
        return times, ()
    return clock.times_s, (
        f"{of.yaml_path}: fps: {of.fps:g} declared, the times in {of.path.name} say {rate:.4g}; "
        "they are rescaled by it (leave fps out if they are true)",
    )


def _doubts(of: DeclaredTrack, table: TrackTable) -> tuple[str, ...]:
    if not table.is_in_frames or of.fps is None or table.frame_s is None:
        return ()
    if abs(of.fps * table.frame_s - 1) <= 0.01:
        return ()
    return (
        f"{of.yaml_path}: fps: {of.fps:g} declared, {of.path.name} says {1 / table.frame_s:.4g}; "
        "the declared rate is used",
    )


def _last_place_m(table: TrackTable, metres: float) -> list[float]:
    """The unit in the last place of each axis, m; 0 where it is not known."""
    return [0.0 if math.isnan(one) else one * metres for one in table.resolution] or [0.0, 0.0]


def _observation(
    names: tuple[str, ...],
    times: np.ndarray,
    position: np.ndarray,
    last_place_m: list[float],
    is_nominal: bool,
) -> Observation:
    """Checks that positions can be metres, and takes their error from their roughness.

    A number is rounded where it is printed; no error is smaller than that.
    """
    rounding = np.diag([(one / math.sqrt(12)) ** 2 for one in last_place_m])
    covariance = []
    for name, place in zip(names, position, strict=True):
        if (count := int(np.isfinite(place[0]).sum())) < MIN_ROWS:
            raise InputError(f"{name}: seen in {count} rows; at least {MIN_ROWS} expected")
        largest = float(np.nanmax(np.abs(place)))
        if largest > MAX_POSITION_M and not is_nominal:
            raise InputError(
                f"{name}: a position of {largest:g} m; correct track_units, "
                "pixels_per_metre or the origin"
            )
        if not is_nominal:
            check_speed(name, times, place)
        rough = roughness_covariance_m2(name, times, place)
        covariance.append(np.maximum(rough, rounding[:, :, None]))
    seen = observed_where_finite(names, times, position, np.array(covariance))
    return replace(seen, rows_of_noise=len(times))

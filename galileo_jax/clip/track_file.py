"""A track file (our own csv or any table) to an observation in metres.

What the file does not say, and the motion does not tell, is asked for: one line names the yaml key
and its possible values.
"""

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from galileo_jax.clip.fields import short
from galileo_jax.clip.lost_frames import lost_text, with_lost_frames
from galileo_jax.clip.plane_noise import roughness_covariance_m2
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipFile
from galileo_jax.clip.table_metres import origin_of, placed, scale_of, unit_of_length, y_axis_of
from galileo_jax.clip.table_objects import declared_table
from galileo_jax.clip.track_axes import (
    along_line,
    check_falls_down,
    in_plane,
    swung,
)
from galileo_jax.clip.track_csv import (
    MAX_POSITION_M,
    MIN_ROWS,
    check_speed,
    check_times,
    read_observation_csv,
)
from galileo_jax.observation.observation import NOMINAL_SCALE_PX_PER_M, Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.grid import read_cells
from galileo_jax.table.pandas_h5 import is_hdf5
from galileo_jax.table.spreadsheet import is_spreadsheet
from galileo_jax.table.text import content_of
from galileo_jax.table.track_table import METRES_PER_UNIT, TrackTable
from galileo_jax.table.tracker_trk import is_trk

TRACK_SUFFIXES = (
    *(".csv", ".txt", ".tsv", ".dat", ".trk", ".trz", ".h5", ".hdf5"),
    *(".xlsx", ".xls", ".ods"),
)
"""Files taken for a track when given as CLIP; what is in them decides the rest."""

OWN_CSV_SAYS = {
    "track_units": "m",
    "track_y": "up",
    "track_origin": (0.0, 0.0),
    "direction": "right",
}
"""What the titles and axes of our own csv say already; a yaml can only repeat it."""


@dataclass(frozen=True)
class FileTrack:
    """What was read.

    Attributes:
      observation: in metres, axes as `Observation` has them.
      unit: of the file: "m", "cm", ..., or "px".
      is_own: our own csv, whose titles and axes are fixed.
      fps: frames per second.
      pixels_per_metre: of a file in pixels; None = unknown (lengths are in nominal metres).
      origin_px: of a file in pixels; None = unknown.
      warnings: doubts, one line each.
    """

    observation: Observation
    unit: str
    fps: float
    is_own: bool = False
    pixels_per_metre: float | None = None
    origin_px: tuple[float, float] | None = None
    warnings: tuple[str, ...] = ()


def is_track(path: Path) -> bool:
    """Whether a file given as CLIP is a track (and no video or yaml)."""
    return path.suffix.lower() in TRACK_SUFFIXES


def read_track(yaml_path: Path, path: Path, file: ClipFile, fps: float | None) -> FileTrack:
    """Reads a track file.

    Args:
      yaml_path: named where a key is missing.
      path: the track.
      file: what is declared.
      fps: declared frames per second; None = not declared.

    Raises:
      InputError: one line naming the file and the place that is wrong, or the key that has to
        be given.
    """
    is_one_table = file.trial is None and not any(item.track_file for item in file.objects)
    is_own = is_one_table and _is_ours(path)
    found = _own(yaml_path, path, file) if is_own else _foreign(yaml_path, path, file, fps)
    check_falls_down(yaml_path, path, file, found.observation)
    return found


def _own(yaml_path: Path, path: Path, file: ClipFile) -> FileTrack:
    """Our own csv, in metres along our axes."""
    _check_own_keys(yaml_path, path, file)
    observation = read_observation_csv(path)
    if file.track_up == "z":
        observation = _turned_up(yaml_path, path, observation)
    _check_names(yaml_path, path, file, observation.names)
    is_level, third = SCENARIOS[file.scenario].is_level, observation.position_m.shape[1] == 3
    if third and is_level != observation.is_turning:
        column = "angle_rad" if observation.is_turning else "z_m"
        raise InputError(
            f"{path}: column '{column}': means nothing in scenario {file.scenario}; leave it out"
        )
    return FileTrack(observation, "m", _frame_rate(observation.times_s), is_own=True)


def _foreign(yaml_path: Path, path: Path, file: ClipFile, fps: float | None) -> FileTrack:
    """Any other table, in its own units and axes."""
    table, warnings = declared_table(yaml_path, path, file, fps)
    times = _times(yaml_path, path, table, fps)
    if len(times) < MIN_ROWS:
        raise InputError(f"{path}: {len(times)} rows; at least {MIN_ROWS} expected")
    check_times(path, times)
    unit = unit_of_length(yaml_path, path, file, table)
    is_px = unit == "px"
    scale = scale_of(yaml_path, path, file, table.calibration) if is_px else None
    origin = origin_of(file, table) if is_px else None
    metres = 1 / (scale or NOMINAL_SCALE_PX_PER_M) if is_px else METRES_PER_UNIT[unit]
    first = _first_seen(table.position)
    times, table = (
        times[first:] - times[first],
        replace(table, position=table.position[..., first:]),
    )
    restored = with_lost_frames(times, table.position)
    times, lost = restored, lost_text(path, times, restored)
    names = tuple(item.name for item in file.objects)
    said: tuple[str, ...] = ()
    if table.axes == ("angle",):
        observation = swung(yaml_path, path, file, times, table.position[:, 0])
    elif len(table.axes) == 1:
        start = table.position[0, 0, 0] if is_px else 0.0
        observation = along_line(
            yaml_path, path, file, table.axes[0], times, (table.position[:, 0] - start) * metres,
            _rounding_m(table, metres)[0],
        )  # fmt: skip
    else:
        table, turned = in_plane(path, file, table)
        y_axis, told = y_axis_of(yaml_path, path, file, table, times, unit)
        said = turned + told
        position = placed(file, table, metres, origin, y_axis, is_px)
        observation = _observation(
            path, names, times, position, _rounding_m(table, metres),
            is_nominal=is_px and scale is None,
        )  # fmt: skip
    return FileTrack(
        observation,
        unit,
        fps=_frame_rate(times) if table.frames is None else 1 / _frame_s(table, fps),
        pixels_per_metre=scale,
        origin_px=origin,
        warnings=table.warnings + warnings + lost + said + _doubts(yaml_path, path, table, fps),
    )


def _rounding_m(table: TrackTable, metres: float) -> tuple[float, ...]:
    """The unit in the last place of each axis, m; 0 where it is not known."""
    return tuple(0.0 if math.isnan(one) else one * metres for one in table.resolution)


OURS = re.compile(r"time_s|\w+_[xy]_m", re.IGNORECASE)


def _is_ours(path: Path) -> bool:
    """Whether it is the csv that `track` writes, or was meant as one, with x and y."""
    content = content_of(path)
    if is_hdf5(content) or is_spreadsheet(content) or is_trk(content):
        return False
    head = [line for line in content[:65_536].replace(b"\0", b"").splitlines() if line.strip()]
    if not any(OURS.search(line.decode("ascii", "ignore")) for line in head[:3]):
        return False
    titles = [title.lower() for title in read_cells(path)[0][1]]
    sides = {axis for axis in "xy" for one in titles if one == f"{axis}_m" or
             one.endswith(f"_{axis}_m")}  # fmt: skip
    is_meant = any(OURS.fullmatch(title) for title in titles)
    return is_meant and len(sides) != 1


def _turned_up(yaml_path: Path, path: Path, observation: Observation) -> Observation:
    """From x, y and z up to x, y up and z."""
    if observation.position_m.shape[1] != 3:
        raise InputError(f"{yaml_path}: track_up: z, but {path.name} has no column z_m")
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return replace(
        observation,
        position_m=np.einsum("ab,obt->oat", turn, observation.position_m),
        covariance_m2=np.einsum("ab,obct,dc->oadt", turn, observation.covariance_m2, turn),
    )


def _check_own_keys(yaml_path: Path, path: Path, file: ClipFile) -> None:
    """Refuses keys that contradict our own csv; a run's yaml repeats what it says."""
    for key, said in OWN_CSV_SAYS.items():
        given = getattr(file, key)
        if given is not None and given != said:
            found = list(given) if isinstance(given, tuple) else given
            raise InputError(
                f"{yaml_path}: {key}: {short(found)} means nothing for {path.name}, whose columns "
                "are in metres, x along the travel, y up, from the foot of the ramp; leave it out, "
                "and correct the columns if they are not"
            )


def _check_names(yaml_path: Path, path: Path, file: ClipFile, names: tuple[str, ...]) -> None:
    declared = tuple(item.name for item in file.objects)
    if declared != names:
        raise InputError(
            f"{yaml_path}: objects: {', '.join(declared)} declared, but {path.name} has "
            f"{', '.join(names)}; the same names in the same order expected"
        )


def _times(yaml_path: Path, path: Path, table: TrackTable, fps: float | None) -> np.ndarray:
    """`[row]`, s."""
    if table.times_s is not None:
        return table.times_s
    assert table.frames is not None  # a reader gives one of the two
    if fps is None and table.frame_s is None:
        has = "has no times" if table.is_counted else "counts frames"
        raise InputError(
            f"{yaml_path}: fps: missing; {path.name} {has}; write fps: and the camera's true "
            "frame rate, such as fps: 30.0"
        )
    return table.frames * _frame_s(table, fps)


def _frame_s(table: TrackTable, fps: float | None) -> float:
    frame_s = 1 / fps if fps else table.frame_s
    assert frame_s is not None  # `_times` has asked for it
    return frame_s


def _doubts(yaml_path: Path, path: Path, table: TrackTable, fps: float | None) -> tuple[str, ...]:
    if table.frames is None or fps is None or table.frame_s is None:
        return ()
    if abs(fps * table.frame_s - 1) <= 0.01:
        return ()
    return (
        f"{yaml_path}: fps: {fps:g} declared, {path.name} says {1 / table.frame_s:.4g}; "
        "the declared rate is used",
    )


def _first_seen(position: np.ndarray) -> int:
    seen = np.isfinite(position).all(axis=1).any(axis=0)
    return int(seen.argmax()) if seen.any() else 0


def _frame_rate(times_s: np.ndarray) -> float:
    return float(1 / np.median(np.diff(times_s)))


def _observation(
    path: Path,
    names: tuple[str, ...],
    times: np.ndarray,
    position: np.ndarray,
    floor_m: tuple[float, ...],
    *,
    is_nominal: bool,
) -> Observation:
    """Checks that positions can be metres, and takes their error from their roughness.

    A number is rounded where it is printed; no error is smaller than that.
    """
    mask = np.asarray(np.isfinite(position[:, 0]))
    covariance = np.full((len(names), 2, 2, len(times)), np.nan)
    rounding = np.diag([(floor / math.sqrt(12)) ** 2 for floor in floor_m or (0.0, 0.0)])
    for index, name in enumerate(names):
        if mask[index].sum() < MIN_ROWS:
            raise InputError(
                f"{path}: {name}: seen in {mask[index].sum()} rows; at least {MIN_ROWS} expected"
            )
        largest = float(np.nanmax(np.abs(position[index])))
        if largest > MAX_POSITION_M and not is_nominal:
            raise InputError(
                f"{path}: {name}: a position of {largest:g} m; correct track_units, "
                "pixels_per_metre or the origin"
            )
        if not is_nominal:
            check_speed(path, name, times, position[index])
        rough = roughness_covariance_m2(path, name, times, position[index])
        covariance[index] = np.maximum(rough, rounding[:, :, None])
        covariance[index][:, :, ~mask[index]] = np.nan
    return Observation(names, times, position, covariance, mask)

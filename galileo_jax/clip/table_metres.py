"""Lengths of a table to metres along the clip's axes: unit, scale, origin, and which way is up.

What is declared counts first, then what the file says, then what the motion shows.
"""

import math
from pathlib import Path

import numpy as np

from galileo_jax.clip.fields import MAX_SCALE_PX_PER_M, MIN_SCALE_PX_PER_M
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipFile
from galileo_jax.clip.track_axes import up_from_motion
from galileo_jax.runtime.errors import InputError
from galileo_jax.table.track_table import METRES_PER_UNIT, Calibration, TrackTable

LENGTH_CHOICES = " | ".join((*METRES_PER_UNIT, "px"))


def unit_of_length(yaml_path: Path, path: Path, file: ClipFile, table: TrackTable) -> str:
    """The unit of length: what is declared, else what the file says."""
    if table.axes == ("angle",):
        return "m"
    by_scale = "px" if file.pixels_per_metre is not None else None
    unit = "px" if table.unit == "px" else file.track_units or table.unit or by_scale
    if unit is None:
        raise InputError(
            f"{yaml_path}: track_units: missing; {path.name} does not state its unit of length; "
            f"write track_units: {LENGTH_CHOICES} (or give it to galileo label)"
        )
    return unit


def scale_of(
    yaml_path: Path, path: Path, file: ClipFile, calibration: Calibration | None
) -> float | None:
    """Pixels per metre: declared, or else the file's; None = unknown."""
    if file.pixels_per_metre is not None:
        return file.pixels_per_metre
    if calibration is None or not math.isfinite(calibration.pixels_per_unit[0]):
        return None
    unit = calibration.unit or file.track_units
    if unit not in METRES_PER_UNIT:
        raise InputError(
            f"{yaml_path}: track_units: missing; {path.name} was calibrated with "
            f"{calibration.pixels_per_unit[0]:.5g} pixels per unit and does not name the unit; "
            f"write track_units: {' | '.join(METRES_PER_UNIT)}"
        )
    scale = calibration.pixels_per_unit[0] / METRES_PER_UNIT[unit]
    if not MIN_SCALE_PX_PER_M <= scale <= MAX_SCALE_PX_PER_M:
        raise InputError(
            f"{path}: calibrated to {scale:.4g} pixels per metre; {MIN_SCALE_PX_PER_M:g} to "
            f"{MAX_SCALE_PX_PER_M:g} expected; correct its calibration or give pixels_per_metre"
        )
    return scale


def origin_of(file: ClipFile, table: TrackTable) -> tuple[float, float] | None:
    """Declared, or else the file's, pixels; None = unknown."""
    if file.origin_px is not None or table.calibration is None:
        return file.origin_px
    return table.calibration.origin_px


def y_axis_of(
    yaml_path: Path, path: Path, file: ClipFile, table: TrackTable, times: np.ndarray, unit: str
) -> tuple[str, tuple[str, ...]]:
    """Which way y points: as declared, as the file says, as the motion shows."""
    if (declared := file.track_y or table.y_axis) is not None:
        return declared, ()
    scenario = SCENARIOS[file.scenario]
    usual = "down" if unit == "px" else "up"
    if scenario.up_shows is None:
        return usual, ()
    found = up_from_motion(scenario.up_shows, times, table.position[0])
    if found is None and scenario.up_shows == "bend":
        found_x = up_from_motion("bend", times, table.position[0, ::-1])
        if found_x is not None:
            return usual, ()  # it falls along x, of which `check_falls_down` tells
    if found is None and scenario.up_shows == "drop" and np.nanstd(table.position[0, 1]) == 0:
        return usual, ()  # a path along the other axis: up makes no difference
    if found is None:
        raise InputError(
            f"{yaml_path}: track_y: missing; {path.name} does not state which way its y axis "
            "points, and the motion does not show it; write track_y: up | down"
        )
    if found == usual:
        return found, ()
    return found, (f"{path}: track_y: {found}, as the motion shows; declare it if it is not",)


def placed(
    file: ClipFile,
    table: TrackTable,
    metres: float,
    origin: tuple[float, float] | None,
    y_axis: str,
    is_px: bool,
) -> np.ndarray:
    """`[object, 2, row]`, m, x along the travel, y up; pixels from object 1 without an origin."""
    position = table.position
    if not is_px:
        origin = file.track_origin or (0.0, 0.0)
    elif origin is None:
        seen = np.flatnonzero(np.isfinite(position[0]).all(axis=0))
        origin = tuple(position[0, :, seen[0]]) if seen.size else (0.0, 0.0)
    x, y = position[:, 0] - origin[0], position[:, 1] - origin[1]
    y = -y if y_axis == "down" else y
    calibration = table.calibration
    if calibration is not None:
        if math.isfinite(calibration.pixels_per_unit[0]):
            y = y * calibration.pixels_per_unit[0] / calibration.pixels_per_unit[1]
        cos, sin = math.cos(calibration.roll_rad), math.sin(calibration.roll_rad)
        x, y = cos * x + sin * y, cos * y - sin * x
    found = np.stack([x if file.direction == "right" else -x, y], axis=1) * metres
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.nan)

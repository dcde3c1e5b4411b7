"""Lengths of a table to metres along the clip's axes: unit, scale, origin, and which way is up.

What is declared counts first, then what the file says, then what the motion shows.
"""

import math

import numpy as np

from galileo_jax.clip.declared_track import DeclaredTrack
from galileo_jax.clip.fields import MAX_SCALE_PX_PER_M, MIN_SCALE_PX_PER_M
from galileo_jax.clip.track_axes import up_from_motion
from galileo_jax.table.track_table import METRES_PER_UNIT, Calibration, TrackTable


def unit_of_length(of: DeclaredTrack, table: TrackTable) -> str:
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


def scale_of(of: DeclaredTrack, calibration: Calibration | None) -> float | None:
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


def y_axis_of(
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
    if found is None:
        raise of.wrong_key(
            f"track_y: missing; {of.path.name} does not state which way its y axis "
            "points, and the motion does not show it; write track_y: up | down"
        )
    return found, (f"{of.path}: track_y: {found}, as the motion shows; declare it if it is not",)


def placed(
    of: DeclaredTrack,
    table: TrackTable,
    metres: float,
    origin: tuple[float, float] | None,
    y_axis: str,
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
    found = np.stack([x if of.file.direction == "right" else -x, y], axis=1) * metres
    return np.where(np.isfinite(found).all(axis=1, keepdims=True), found, np.nan)

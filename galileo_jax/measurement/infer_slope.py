"""The slope of a ramp that nobody measured, from the path of the object that comes down it.

    direction of the path = principal axis of the points seen on the ramp

A point fixed to a sliding object stays at one distance from the surface, so its path is parallel
to the ramp whatever point it is. The picture's vertical is taken for gravity's.
"""

import math
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.fields import MAX_ANGLE_SD_DEG, MIN_RAMP_ANGLE_DEG
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

LEVEL_SD_DEG = 0.5
"""How level a camera stands on a tripod, and how straight a lens draws: the error that the points'
own scatter does not show."""

MAX_SCATTER_SD_DEG = 2.0
"""A path that tells its slope no better than this does not tell it."""

UPPER_SHARE = 0.75
"""Of the way down to the table; further down the object's front is on the table already."""

MIN_POINTS = 5
BEGIN_SHARE, LEAST_BEND = 0.5, 0.01
"""Of the way: its begin; by how many rad, at least, a valley's slope changes there."""


@dataclass(frozen=True)
class Slope:
    """The slope of a ramp.

    Attributes:
      angle_deg: from the picture's horizontal, downhill positive.
      sd_deg: its standard deviation.
    """

    angle_deg: float
    sd_deg: float


def needs_slope(clip: Clip) -> bool:
    """Whether the clip has a ramp of unknown angle."""
    return SCENARIOS[clip.scenario].has_ramp and clip.ramp_angle_deg is None


def infer_slope(clip: Clip, observation: Observation) -> Slope:
    """The slope of the way that the first object takes down the ramp.

    Raises:
      InputError: it hardly moves on the ramp, against the declared direction, or on the level.
    """
    name = observation.names[0]
    points = observation.position_m[0][:, observation.mask[0]]
    has_foot = SCENARIOS[clip.scenario].has_table and points.size > 0
    if has_foot:
        start = points[0, 0]
        points = points[:, points[0] < (1 - UPPER_SHARE) * min(start, 0.0)]
    remedy = "give the angle in degrees, or `galileo label --ramp X1 Y1 X2 Y2`"
    if points.shape[1] < MIN_POINTS:
        where = " left of origin_px, the ramp's foot" if has_foot else ""
        raise InputError(
            f"{clip.path}: ramp_angle_deg: null, and {name} is seen in {points.shape[1]} frames"
            f"{where}; too few to determine the slope; {remedy}"
        )
    away = points - points.mean(axis=1, keepdims=True)
    values, axes = np.linalg.eigh(away @ away.T)
    # Where a board is curved, what goes down may come back.
    gone = points - points[:, :1]
    furthest = gone[:, np.argmax((gone**2).sum(axis=0))]
    along = axes[:, 1] if axes[:, 1] @ furthest >= 0 else -axes[:, 1]
    scatter_m = math.sqrt(max(values[0], 0.0) / (points.shape[1] - 2))
    scatter_m = max(scatter_m, _noise_m(observation))
    sd_deg = math.degrees(scatter_m / math.sqrt(max(values[1], 1e-30)))
    if sd_deg > MAX_SCATTER_SD_DEG:
        length_m = float(np.ptp(along @ points))
        unit = "m" if clip.is_scale_known else "of the picture's units"
        raise InputError(
            f"{clip.path}: ramp_angle_deg: null, and {name} moves by only {length_m:.3g} {unit} on "
            f"the ramp, too little to determine the slope; {remedy}"
        )
    if along[0] < 0:
        if clip.is_own_track:
            raise InputError(
                f"{clip.path}: track: {name}'s x decreases; x along the travel expected; turn the "
                "sign of the csv's x columns"
            )
        other = "left" if clip.direction == "right" else "right"
        raise InputError(
            f"{clip.path}: direction: {clip.direction}, but {name} moves to the {other}; "
            f"write direction: {other}"
        )
    angle_deg = math.degrees(math.atan2(-along[1], along[0]))
    if angle_deg < MIN_RAMP_ANGLE_DEG:
        # A valley: what rolls down into it comes to rest as high as it began.
        angle_deg = max(angle_deg, _at_start_deg(gone, along))
    if not MIN_RAMP_ANGLE_DEG <= angle_deg < 90:
        raise InputError(
            f"{clip.path}: ramp_angle_deg: null, and {name}'s path falls by {angle_deg:.1f} "
            f"degrees: no ramp; {remedy}"
        )
    sd_deg = min(math.hypot(sd_deg, LEVEL_SD_DEG), MAX_ANGLE_SD_DEG)
    return Slope(round(angle_deg, 3), round(sd_deg, 3))


def _at_start_deg(gone: np.ndarray, along: np.ndarray) -> float:
    """The slope of the first part of a way into a valley, of a parabola through it; else -90."""
    way = along @ gone
    first = (way < BEGIN_SHARE * way.max()) & (np.arange(len(way)) <= int(np.argmax(way)))
    if first.sum() < MIN_POINTS or np.ptp(way[first]) <= 0:
        return -90.0
    bend, slope, _ = np.polyfit(gone[0, first], gone[1, first], 2)
    is_valley = bend * np.ptp(gone[0, first]) > LEAST_BEND
    return math.degrees(math.atan(-slope)) if is_valley else -90.0


def _noise_m(observation: Observation) -> float:
    covariance = observation.covariance_m2[0][:, :, observation.mask[0]]
    return math.sqrt(float(np.median(np.trace(covariance))) / 2)

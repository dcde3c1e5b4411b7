"""The foot of a ramp that nobody marked, from the bend of the path.

A centre runs half the object's height h above either surface, so that the lines of its path
before and after the foot meet at

    foot + (h tan(a/2), h),   a the angle between them
"""

import math
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError

MIN_POINTS = 5
"""On either side of the bend."""

MIN_BEND_DEG = 4.0
"""A path that bends by less shows no foot."""


@dataclass(frozen=True)
class Line:
    """A straight line through points of a plane.

    Attributes:
      middle: `[2]`, m, on it.
      along: `[2]`, unit vector in the direction of the travel.
      misfit_m2: summed squared distances of the points.
    """

    middle: np.ndarray
    along: np.ndarray
    misfit_m2: float


def needs_foot(clip: Clip) -> bool:
    """Whether the foot of the ramp is missing in a clip in pixels."""
    in_pixels = clip.track_units in (None, "px")
    return SCENARIOS[clip.scenario].has_table and in_pixels and clip.origin_px is None


def infer_foot(clip: Clip, observation: Observation) -> np.ndarray:
    """Where the ramp meets the table, `[2]`, m, in the observation's axes.

    Args:
      clip: with the size of its first object.
      observation: of any origin.

    Raises:
      InputError: the size is unknown, or the path does not bend.
    """
    from galileo_jax.model.scene.scene import extents

    first = clip.objects[0]
    remedy = "set it with `galileo label --origin X Y`"
    if first.size_m is None:
        raise InputError(
            f"{clip.path}: origin_px: null, and {first.name}'s size_m is null, too; the foot of "
            f"the path shows the ramp only together with its height; {remedy}"
        )
    points = observation.position_m[0][:, observation.mask[0]]
    count = points.shape[1]
    splits = range(MIN_POINTS, count - MIN_POINTS + 1)
    best = min(splits, key=lambda at: _misfit(points, at), default=None)
    no_bend = InputError(
        f"{clip.path}: origin_px: null, and {first.name}'s path does not bend: the foot of the "
        f"ramp is not declared; {remedy}"
    )
    if best is None:
        raise no_bend
    before, after = _line(points[:, :best]), _line(points[:, best:])
    if not _bend(before, after) >= math.radians(MIN_BEND_DEG):
        raise no_bend
    # While the object turns its centre leaves both lines: those points are left out.
    half_length, half_height = extents(first)
    bend = _meeting(before, after)
    way = np.linalg.norm(points - bend[:, None], axis=0) > 1.5 * half_length
    is_before = np.arange(count) < best
    if min((way & is_before).sum(), (way & ~is_before).sum()) >= MIN_POINTS:
        before, after = _line(points[:, way & is_before]), _line(points[:, way & ~is_before])
        bend = _meeting(before, after)
    half_angle = _bend(before, after) / 2
    return bend - np.array([half_height * math.tan(half_angle), half_height])


def _misfit(points: np.ndarray, at: int) -> float:
    return _line(points[:, :at]).misfit_m2 + _line(points[:, at:]).misfit_m2


def _line(points: np.ndarray) -> Line:
    """The line of least summed squared distances from points `[2, point]` in order."""
    middle = points.mean(axis=1)
    away = points - middle[:, None]
    values, axes = np.linalg.eigh(away @ away.T)
    along = axes[:, 1] * (1.0 if axes[:, 1] @ (points[:, -1] - points[:, 0]) >= 0 else -1.0)
    return Line(middle, along, float(max(values[0], 0.0)))


def _bend(before: Line, after: Line) -> float:
    """By how much the second line is less steep, rad."""
    steep = [math.atan2(-line.along[1], line.along[0]) for line in (before, after)]
    return steep[0] - steep[1]


def _meeting(before: Line, after: Line) -> np.ndarray:
    """Where two lines cross, `[2]`."""
    gone = np.linalg.solve(
        np.stack([before.along, -after.along], axis=1), after.middle - before.middle
    )
    return before.middle + gone[0] * before.along

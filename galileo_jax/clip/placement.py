"""Checks that the declared object positions are physically possible.

Positions are clicked by eye, and angle and scale may be slightly wrong (the fit allows for that).
Only contradictions larger than such errors are refused.
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.clip.sizes import half_sides

MIN_TOLERANCE_M = 0.005  # nobody clicks a centre better than this on a blurred or textured object
TOLERANCE_PX = 4.0  # how far a clicked point is easily off
TOLERANCE_PER_SIZE = 0.125  # a point meant as the centre lies in the middle quarter of the object
TOLERANCE_PER_DISTANCE = 0.06
"""Error of height per metre from the foot: a declared angle that is off by 3.4 degrees."""

MEND = {
    "pixels": (
        "correct point_px, origin_px, ramp_angle_deg, direction, size_m or pixels_per_metre",
        "correct point_px, size_m or pixels_per_metre",
    ),
    "lengths": (
        "correct track_origin, ramp_angle_deg, direction, size_m or track_units",
        "correct size_m or track_units",
    ),
    "own csv": (
        "correct ramp_angle_deg, size_m or the csv (x along, y up, from the foot)",
        "correct size_m or the csv's columns",
    ),
}
"""What may be wrong where an object cannot stand, and where two reach into each other."""

MIN_SIZE_PX = 2.0
"""An object that would appear smaller cannot be followed: its size or the scale is wrong."""


@dataclass(frozen=True)
class Outline:
    """An object seen from the side: a box, or a disc that surely fits into it."""

    centre_m: np.ndarray  # `[2]`, x along the travel, y up
    half_sides_m: tuple[float, float]  # half its length and half its height
    is_box: bool
    angle_rad: float  # of the box against the table, positive where it points downhill

    def axes(self) -> list[np.ndarray]:
        """The directions of a box's sides."""
        if not self.is_box:
            return []
        c, s = math.cos(self.angle_rad), math.sin(self.angle_rad)
        return [np.array([c, -s]), np.array([s, c])]

    def half_width(self, direction: np.ndarray) -> float:
        """Half its extent along a unit vector, m."""
        if not self.is_box:
            return min(self.half_sides_m)
        sides = zip(self.half_sides_m, self.axes(), strict=True)
        return sum(half * abs(float(axis @ direction)) for half, axis in sides)


def centres_from_pixels(clip: Clip) -> dict[str, np.ndarray]:
    """The marked points in metres, x along the travel, y up.

    The origin is `origin_px`, or without one the frame's corner. Empty without a scale.
    """
    if clip.pixels_per_metre is None:
        return {}
    plane = picture_plane(clip, clip.origin_px or (0.0, 0.0))
    return {
        item.name: plane.to_metres(np.array(item.point_px))
        for item in clip.objects
        if item.point_px is not None
    }


def find_misplacement(clip: Clip, centres_m: dict[str, np.ndarray]) -> tuple[str, str] | None:
    """(key, what is wrong) of the first object that cannot stand there, or None.

    Looks at the objects whose size and centre are known: does one reach into the ramp or
    the table, hang in the air above them, or reach into another object?

    `centres_m`: name to `[2]`, m; x along the travel, y up, origin at the foot of the ramp.
    """
    if not clip.is_scale_known:
        return None
    in_pixels = clip.track is None or clip.track_units == "px"
    pixel_m = 1 / clip.pixels_per_metre if clip.pixels_per_metre and in_pixels else 0.0
    origin = clip.origin_px if in_pixels else clip.track_origin
    has_origin = clip.is_own_track or origin is not None
    scenario = SCENARIOS[clip.scenario]
    is_on_ramp = scenario.is_sloped and has_origin and clip.ramp_angle_deg is not None
    mend, mend_pair = MEND["own csv" if clip.is_own_track else "pixels" if in_pixels else "lengths"]
    angle = math.radians(clip.ramp_angle_deg or 0.0)
    placed = [
        (index, item, _outline(item, centres_m[item.name], angle if is_on_ramp else 0.0))
        for index, item in enumerate(clip.objects)
        if item.size_m is not None and item.name in centres_m
    ]
    for index, item, outline in placed if is_on_ramp else ():
        problem = _against_surfaces(outline, angle, scenario.has_table, pixel_m)
        if problem:
            return f"objects[{index}] ({item.name})", f"{problem}; {mend}"
    for (_, first, a), (index, second, b) in itertools.combinations(placed, 2):
        if first.first_frame != second.first_frame:
            continue
        depth_m = _penetration_m(a, b)
        if depth_m > _tolerance_m(a, pixel_m) + _tolerance_m(b, pixel_m):
            deep = f"by about {1000 * depth_m:.0f} mm at the start"
            return (
                f"objects[{index}] ({second.name})",
                f"reaches into {first.name} {deep}; {mend_pair}",
            )
    return None


def find_odd_size(clip: Clip) -> tuple[str, str] | None:
    """(key, what is wrong) of the first object too large or small for the frame, or None."""
    if clip.frame_size_px is None or clip.pixels_per_metre is None:
        return None
    for index, item in enumerate(clip.objects):
        if item.size_m is None:
            continue
        size_px = 2 * max(half_sides(item.shape, item.size_m)) * clip.pixels_per_metre
        if not MIN_SIZE_PX <= size_px <= max(clip.frame_size_px):
            width, height = clip.frame_size_px
            return (
                f"objects[{index}].size_m ({item.name})",
                f"{list(item.size_m)} m would be {size_px:.3g} px at {clip.pixels_per_metre:g} "
                f"pixels per metre, in a frame of {width} x {height}; correct size_m or "
                "pixels_per_metre",
            )
    return None


def _outline(item: ClipObject, centre_m: np.ndarray, ramp_angle_rad: float) -> Outline:
    assert item.size_m is not None
    angle = ramp_angle_rad if centre_m[0] < 0 else 0.0
    return Outline(centre_m, half_sides(item.shape, item.size_m), item.shape == "box", angle)


def _tolerance_m(outline: Outline, pixel_m: float) -> float:
    by_size = TOLERANCE_PER_SIZE * 2 * min(outline.half_sides_m)
    return max(MIN_TOLERANCE_M, TOLERANCE_PX * pixel_m, by_size)


def _against_surfaces(
    outline: Outline, angle_rad: float, has_table: bool, pixel_m: float
) -> str | None:
    x, y = (float(value) for value in outline.centre_m)
    above_ramp = y * math.cos(angle_rad) + x * math.sin(angle_rad)
    surface = "table" if has_table and y < above_ramp else "ramp"
    clearance = min(above_ramp, y) if has_table else above_ramp
    tolerance = _tolerance_m(outline, pixel_m) + TOLERANCE_PER_DISTANCE * math.hypot(x, y)
    # A disc may rest in any of its ways.
    heights = outline.half_sides_m[1:] if outline.is_box else outline.half_sides_m
    if clearance < min(heights) - tolerance:
        depth_mm = 1000 * (min(heights) - clearance)
        return f"stands {depth_mm:.0f} mm inside the {surface} at the start"
    if clearance > 2 * max(heights) + tolerance:
        gap_mm = 1000 * (clearance - max(heights))
        return f"hangs {gap_mm:.0f} mm above the {surface} at the start"
    return None


def _penetration_m(a: Outline, b: Outline) -> float:
    """How deep two outlines overlap, m; negative when apart (separating axes)."""
    between = b.centre_m - a.centre_m
    distance = float(np.linalg.norm(between))
    axes = [*a.axes(), *b.axes()]
    axes.append(between / distance if distance > 0 else np.array([1.0, 0.0]))
    return min(
        a.half_width(axis) + b.half_width(axis) - abs(float(between @ axis)) for axis in axes
    )

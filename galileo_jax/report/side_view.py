"""The scene drawn from the side: which part of it is shown, and the shapes in it.

`animation.py` moves the shapes in a page; `draw_still` makes a picture of them.
"""

import math
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.model.scene.scene import Scene
from galileo_jax.observation.observation import NOMINAL_SCALE_PX_PER_M
from galileo_jax.report.style import object_colour, palette
from galileo_jax.rollout.motion import pitch

LARGEST_PX = 960
MARGIN_M = 0.08
SLAB_M = 0.012  # how thick ramp and table are drawn
RAIL_M = 0.001  # half a wall's width, seen from above
CIRCLE_CORNERS = 72
SUBPIXEL_BITS = 4


@dataclass(frozen=True)
class View:
    """A side view without perspective.

    Attributes:
      left_m, right_m, bottom_m, top_m: the picture's edges in the scene.
      width_px, height_px: its size.
      is_mirrored: the travel is to the left in the picture.
    """

    left_m: float
    right_m: float
    bottom_m: float
    top_m: float
    width_px: int
    height_px: int
    is_mirrored: bool


def view_of(clip: Clip, scene: Scene, positions_m: np.ndarray) -> View:
    """What the video shows; without a video all of `positions_m` `[..., 2, frame]`, but for NaN."""
    # As in `observe`: without a declared foot the first object's first place is the origin.
    origin = clip.origin_px or clip.objects[0].point_px if clip.is_camera_plain else None
    if clip.frame_size_px and origin:
        (width, height), (x, y) = clip.frame_size_px, origin
        scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
        left, right = -x / scale, (width - x) / scale
        bottom, top = (y - height) / scale, y / scale
        enlarge = min(1.0, LARGEST_PX / max(width, height))
    else:
        places = np.moveaxis(positions_m, -2, -1).reshape(-1, 2)
        reach = MARGIN_M + max(scene.surroundings.half_length_m)
        (left, bottom), (right, top) = (
            np.nanmin(places, axis=0) - reach,
            np.nanmax(places, axis=0) + reach,
        )
        width, height = right - left, top - bottom
        enlarge = LARGEST_PX / max(width, height)
    is_mirrored = clip.direction == "left"
    if is_mirrored and clip.frame_size_px and origin:
        left, right = -right, -left
    size = (2 * round(width * enlarge / 2), 2 * round(height * enlarge / 2))
    return View(float(left), float(right), float(bottom), float(top), *size, is_mirrored)


def surfaces(scene: Scene, view: View) -> list[np.ndarray]:
    """Ramp and table as slabs, corners `[4, 2]`, m; none where nothing carries the objects.

    Of a table seen from above its walls.

    The first two corners are the ends of the surface; slabs reach to the edges of the view.
    """
    surroundings = scene.surroundings
    angle = surroundings.angle_rad
    if not surroundings.has_surface or surroundings.is_level:
        return [_rail(np.array(ends)) for ends in surroundings.walls_m]
    if scene.has_table:
        start_x = surroundings.start_m[0][0]
        length = min(
            -view.left_m / math.cos(angle),
            -start_x / math.cos(angle) + 2 * surroundings.half_length_m[0],
        )
        foot = (0.0, 0.0)
        top = (-length * math.cos(angle), length * math.sin(angle))
        return [_slab(top, foot), _slab(foot, (view.right_m, 0.0))]
    (x, y), height = surroundings.start_m[0], surroundings.half_height_m[0]
    x, y = x - height * math.sin(angle), y - height * math.cos(angle)  # under the object
    ends = [(edge, y - (edge - x) * math.tan(angle)) for edge in (view.left_m, view.right_m)]
    return [_slab(*ends)]


def _slab(start: tuple[float, float], end: tuple[float, float]) -> np.ndarray:
    upper = np.array([start, end])
    return np.concatenate([upper, upper[::-1] - (0.0, SLAB_M)])


def _rail(ends: np.ndarray) -> np.ndarray:
    """A wall seen from above, as wide on either side of its line."""
    along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    aside = RAIL_M * np.array([-along[1], along[0]])
    return np.concatenate([ends + aside, ends[::-1] - aside])


def outline(clip: Clip, scene: Scene, index: int) -> np.ndarray:
    """The corners of an object around its centre, before it turns, `[corner, 2]`, m."""
    length, height = (
        size[index] for size in (scene.surroundings.half_length_m, scene.surroundings.half_height_m)
    )
    if clip.objects[index].shape == "sphere" or scene.surroundings.is_level:
        angle = np.linspace(0.0, 2 * np.pi, CIRCLE_CORNERS, endpoint=False)
        return length * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    return np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * (length, height)


def draw_still(clip: Clip, scene: Scene, view: View, position_m: np.ndarray) -> np.ndarray:
    """A picture of the objects with their centres at `position_m` `[object, 2]`.

    Returns:
      `[height, width, 3]`, uint8 RGB.
    """
    picture = np.empty((view.height_px, view.width_px, 3), np.uint8)
    picture[:] = _rgb("card")
    for slab in surfaces(scene, view):
        _fill(picture, view, slab, "surface")
    turned = pitch(position_m, scene.surroundings)
    for i, (centre, angle) in enumerate(zip(position_m, map(float, turned), strict=True)):
        cos, sin = math.cos(angle), math.sin(angle)
        corners = outline(clip, scene, i) @ np.array([[cos, sin], [-sin, cos]]) + centre
        _fill(picture, view, corners, object_colour(i))
    return picture[:, ::-1] if view.is_mirrored else picture


def _fill(picture: np.ndarray, view: View, corners_m: np.ndarray, colour: str) -> None:
    import cv2

    scale = view.width_px / (view.right_m - view.left_m)
    pixels = scale * (corners_m - (view.left_m, view.top_m)) * (1, -1) - 0.5
    fixed = np.round(pixels * 2**SUBPIXEL_BITS).astype(np.int32)
    cv2.fillPoly(picture, [fixed], _rgb(colour), cv2.LINE_AA, SUBPIXEL_BITS)


def _rgb(colour: str) -> tuple[int, ...]:
    return tuple(bytes.fromhex(palette()[colour][1:]))

"""The scene seen from the side: what part of the world a picture shows, and a drawn picture."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.model.scene.scene import Scene
from galileo_jax.observation.observation import NOMINAL_SCALE_PX_PER_M
from galileo_jax.report.figure import COLOURS, INK
from galileo_jax.results.run import Run
from galileo_jax.rollout.motion import pitch

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LARGEST_PX = 960
MARGIN_M = 0.08
SLAB_M = 0.012  # how thick ramp and table are drawn
SURFACE = "#b9b4aa"


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


@dataclass(frozen=True)
class Still:
    """The objects at one instant: centres `[object, 2]`, m, and what to call it."""

    position_m: np.ndarray
    title: str


def view_of(clip: Clip, scene: Scene, positions_m: np.ndarray) -> View:
    """What the video shows; without one all of `positions_m` `[..., 2, frame]`, NaN left out."""
    # As in `observe`: without a declared foot the first object's first place is the origin.
    origin = clip.origin_px or clip.objects[0].point_px
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


def surfaces(scene: Scene, view: View) -> list[tuple[tuple[float, float], float, float]]:
    """Ramp and table as (upper end that is nearest the foot, length, angle of its direction).

    Lengths reach to the view's edges; the angle is counter-clockwise, rad. None in a fall.
    """
    surroundings = scene.surroundings
    angle = surroundings.angle_rad
    if not surroundings.has_surface:
        return []
    if scene.has_table:
        longest = (-view.left_m) / math.cos(angle)
        start_x = surroundings.start_m[0][0]
        length = min(longest, -start_x / math.cos(angle) + 2 * surroundings.half_length_m[0])
        return [((0.0, 0.0), length, math.pi - angle), ((0.0, 0.0), view.right_m, 0.0)]
    (x, y), height = surroundings.start_m[0], surroundings.half_height_m[0]
    foot_x, foot_y = x - height * math.sin(angle), y - height * math.cos(angle)
    back = (foot_x - view.left_m) / math.cos(angle)
    length = (view.right_m - view.left_m) / math.cos(angle)
    top = (foot_x - back * math.cos(angle), foot_y + back * math.sin(angle))
    return [(top, length, -angle)]


def draw(axes: "Axes", run: Run, still: Still, view: View) -> None:
    """Draws the scene with plain shapes."""
    from matplotlib.patches import Circle, Polygon

    scene = run.problem.model.scene
    for (x, y), length, angle in surfaces(scene, view):
        end = (x + length * math.cos(angle), y + length * math.sin(angle))
        below = SLAB_M / math.cos(angle)
        corners = [(x, y), end, (end[0], end[1] - abs(below)), (x, y - abs(below))]
        axes.add_patch(Polygon(corners, color=SURFACE, linewidth=0))
    turned = pitch(still.position_m, scene.surroundings)
    for i, (declared, (x, y)) in enumerate(zip(run.clip.objects, still.position_m, strict=True)):
        length = scene.surroundings.half_length_m[i]
        height = scene.surroundings.half_height_m[i]
        if declared.shape == "sphere":
            axes.add_patch(Circle((x, y), length, color=COLOURS[i % len(COLOURS)], linewidth=0))
            continue
        cos, sin = math.cos(float(turned[i])), math.sin(float(turned[i]))
        corners = [
            (x + a * length * cos - b * height * sin, y + a * length * sin + b * height * cos)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))
        ]
        axes.add_patch(Polygon(corners, color=COLOURS[i % len(COLOURS)], linewidth=0))
    for side in axes.spines.values():
        side.set(visible=True, color=INK, alpha=0.3)

"""The scene drawn from the side: which part of it is shown, and the shapes in it.

`animation.py` moves the shapes in a page; `write_first_and_last` makes a picture of them.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.model.scene.scene import Scene
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.prediction.extrapolate import Motions, as_measured
from galileo_jax.report.style import matplotlib_style, object_colour, palette
from galileo_jax.report.video_frames import first_and_last_frame
from galileo_jax.results.run import Run
from galileo_jax.rollout.motion import pitch
from galileo_jax.runtime.atomic_write import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MARGIN_M = 0.08
SLAB_M = 0.012  # how thick ramp and table are drawn
RAIL_M = 0.001  # half a wall's width, seen from above
CIRCLE_CORNERS = 72
COLUMN_IN, TITLE_IN = 4.8, 0.3  # of the picture


@dataclass(frozen=True)
class View:
    """A side view without perspective."""

    # The picture's edges in the scene.
    left_m: float
    right_m: float
    bottom_m: float
    top_m: float
    is_mirrored: bool  # the travel is to the left in the picture

    @property
    def size_m(self) -> tuple[float, float]:
        """Width and height."""
        return self.right_m - self.left_m, self.top_m - self.bottom_m


def view_of(clip: Clip, scene: Scene, positions_m: np.ndarray) -> View:
    """What the video shows; without a video all of `positions_m` `[..., 2, frame]`, but for NaN."""
    # As in `observe`: without a declared foot the first object's first place is the origin.
    origin = clip.origin_px or clip.objects[0].point_px if clip.is_camera_plain else None
    is_mirrored = clip.direction == "left"
    if clip.frame_size_px and origin:
        (width, height), (x, y) = clip.frame_size_px, origin
        scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
        left, right = (-x / scale, (width - x) / scale)
        if is_mirrored:
            left, right = -right, -left
        bottom, top = (y - height) / scale, y / scale
    else:
        places = np.moveaxis(positions_m, -2, -1).reshape(-1, 2)
        reach = MARGIN_M + max(scene.surroundings.half_length_m)
        left, bottom = np.nanmin(places, axis=0) - reach
        right, top = np.nanmax(places, axis=0) + reach
    return View(float(left), float(right), float(bottom), float(top), is_mirrored)


def surfaces(scene: Scene, view: View) -> list[np.ndarray]:
    """Ramp and table as slabs, corners `[4, 2]`, m; none where nothing carries the objects.

    Of a table seen from above its walls.

    The first two corners are the ends of the surface; slabs reach to the edges of the view.
    """
    surroundings = scene.surroundings
    angle = surroundings.angle_rad
    if not surroundings.has_surface or surroundings.is_level:
        return [_rail(np.array(ends)) for ends in surroundings.walls_m]
    if surroundings.has_table:
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


def draw_still(axes: "Axes", clip: Clip, scene: Scene, view: View, position_m: np.ndarray) -> None:
    """Draws the objects with their centres at `position_m` `[object, 2]`."""
    for slab in surfaces(scene, view):
        axes.fill(*slab.T, color=palette()["surface"], linewidth=0)
    turned = pitch(position_m, scene.surroundings)
    for i, (centre, angle) in enumerate(zip(position_m, map(float, turned), strict=True)):
        cos, sin = math.cos(angle), math.sin(angle)
        corners = outline(clip, scene, i) @ np.array([[cos, sin], [-sin, cos]]) + centre
        axes.fill(*corners.T, color=palette()[object_colour(i)], linewidth=0)
    ends = (view.left_m, view.right_m)
    axes.set(xlim=ends[::-1] if view.is_mirrored else ends, ylim=(view.bottom_m, view.top_m))
    axes.set(facecolor=palette()["card"], aspect="equal")


def write_first_and_last(run: Run, motions: Motions, path: Path) -> None:
    """Writes a PNG: first and last frame of the clip beside the simulated ones, and the end.

    The frames of the video, where there is one, are on the left.
    """
    from matplotlib.figure import Figure

    clip, scene = run.clip, run.problem.model.scene
    median = np.median(as_measured(run.problem.model, motions), axis=0)
    clip_end_s = float(run.problem.observation.times_s[-1])
    last = int(np.searchsorted(motions.times_s, clip_end_s - 1e-9))
    view = view_of(clip, scene, median)
    stills = {
        "simulated, first frame": 0,
        f"simulated, last frame ({clip_end_s:.2f} s)": last,
        f"predicted, {motions.times_s[-1]:.2f} s": -1,
    }
    frames = first_and_last_frame(clip.video) if clip.video else []
    sizes = [view.size_m, *(frame.shape[1::-1] for frame in frames)]
    row_in = COLUMN_IN * max(height / width for width, height in sizes) + TITLE_IN
    columns = 2 if frames else 1
    with matplotlib_style("first_and_last"), replacing(path) as temporary:
        figure = Figure(figsize=(COLUMN_IN * columns, row_in * len(stills)), dpi=130)
        grid = figure.subplots(len(stills), columns, squeeze=False)
        top = 1 - TITLE_IN / (row_in * len(stills))
        figure.subplots_adjust(0.01, 0.01, 0.99, top, 0.03, 0.16)
        for axes in grid.flat:
            axes.set(xticks=[], yticks=[])
            axes.spines[:].set(visible=True, alpha=0.3)
        for axes, (title, index) in zip(grid[:, -1], stills.items(), strict=True):
            draw_still(axes, clip, scene, view, median[..., index])
            axes.set(title=title)
        if frames:
            titles = ("first frame", "last frame")
            for axes, title, frame in zip(grid[:, 0], titles, frames, strict=False):
                axes.imshow(frame)
                axes.set(title=title)
            for axes in grid[len(frames) :, 0]:
                axes.set_axis_off()
        figure.savefig(temporary)

"""A picture of a film in which what moves is numbered, with its way, its angle and a ruler.

For somebody who is asked which of the things is meant, or how steep the ramp is.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.report.style import matplotlib_style, object_colour, palette
from galileo_jax.runtime.atomic_write import replacing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

WIDTH_IN, DPI = 9.6, 100
RULER_PX = 100
NAME_GAP_PX = 4.0  # between a box and its number


@dataclass(frozen=True)
class Marked:
    """A thing in a picture; pixels, x right, y down."""

    name: str  # that stands beside it: its number, or what it is called
    middle_px: tuple[float, float]  # of the thing
    size_px: tuple[float, float] | None = None  # (width, height); None where nobody knows
    # `[2, place]`, where it is one picture after the other; empty: not known.
    way_px: np.ndarray | None = None
    slope_deg: float | None = None  # of a straight way against the horizontal; None of others


def write_marked_picture(path: Path, frame: np.ndarray, things: Sequence[Marked]) -> Path:
    """Writes a picture `[height, width, 3]`, RGB, with its things marked, by the path's suffix."""
    from matplotlib.figure import Figure

    height, width = frame.shape[:2]
    with matplotlib_style("marked"), replacing(path) as temporary:
        figure = Figure(figsize=(WIDTH_IN, WIDTH_IN * height / width), dpi=DPI)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.imshow(frame)
        axes.set_axis_off()
        for index, thing in enumerate(things):
            _mark(axes, thing, palette()[object_colour(index)])
        _draw_ruler(axes, width, height)
        axes.set(xlim=(-0.5, width - 0.5), ylim=(height - 0.5, -0.5))
        figure.savefig(temporary)
    return path


def _mark(axes: "Axes", thing: Marked, colour: str) -> None:
    from matplotlib.patches import Rectangle

    x, y = thing.middle_px
    width, height = thing.size_px or (0.0, 0.0)
    if thing.way_px is not None and thing.way_px.size:
        axes.plot(*thing.way_px, color="white", linewidth=3.5)
        axes.plot(*thing.way_px, color=colour, linewidth=1.8)
        if thing.slope_deg is not None:
            _draw_angle(axes, thing.way_px, thing.slope_deg)
    if thing.size_px is not None:
        corner = (x - width / 2, y - height / 2)
        for edge, line in ("white", 3.5), (colour, 1.8):
            axes.add_patch(Rectangle(corner, width, height, fill=False, ec=edge, lw=line))
    else:
        axes.plot(x, y, "+", color=colour, markersize=14, markeredgewidth=2)
    top = max(y - height / 2 - NAME_GAP_PX, 2 * NAME_GAP_PX)
    _write(axes, x - width / 2, top, thing.name, colour, size=13.0)


def _draw_angle(axes: "Axes", way_px: np.ndarray, slope_deg: float) -> None:
    """The horizontal through the lower end of a way, and the angle between the two."""
    low = int(np.argmax(way_px[1]))
    x, y = way_px[:, low]
    reach = way_px[0, int(np.argmax(abs(way_px[0] - x)))] - x
    for colour, line in ("black", 2.4), ("white", 1.2):
        axes.plot([x, x + reach], [y, y], color=colour, linewidth=line, linestyle="--")
    _write(axes, x + reach / 2, y - NAME_GAP_PX, f"{slope_deg:.1f}°", "black")


def _draw_ruler(axes: "Axes", width: int, height: int) -> None:
    """So many pixels, in the lower left corner; tenths of them where the picture is small."""
    length = RULER_PX if width >= 2 * RULER_PX else RULER_PX // 10
    x, y = 0.03 * width, 0.96 * height
    for colour, line in ("black", 5.0), ("white", 2.5):
        axes.plot([x, x + length], [y, y], color=colour, linewidth=line, solid_capstyle="butt")
    _write(axes, x, y - NAME_GAP_PX, f"{length} px", "black")


def _write(axes: "Axes", x: float, y: float, text: str, colour: str, size: float = 10.0) -> None:
    look = {"facecolor": "white", "alpha": 0.75, "edgecolor": "none", "pad": 1.5}
    axes.text(x, y, text, color=colour, fontsize=size, va="bottom", bbox=look)

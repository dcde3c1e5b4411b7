"""Draws a `Chart`: as a Plotly figure for notebooks, as a still picture for papers and slides.

Two libraries, because neither does both: Plotly's figures are interactive and need no network,
but its still pictures need Chrome; Matplotlib's SVG needs nothing. Both follow one `Layout`. Pages
have Plotly's figures as plain JSON (`plotly_figure.py`).
"""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.report.chart import (
    CELL_PX,
    RIGHT_PX,
    Band,
    Bars,
    Boxes,
    Chart,
    Line,
    Mark,
    Panel,
    Points,
    layout_of,
)
from galileo_jax.report.plotly_figure import figure
from galileo_jax.report.style import matplotlib_style, palette, save_svg
from galileo_jax.runtime.atomic_write import replacing, write_text

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PX_PER_INCH, POINTS_PER_PX = 100, 0.72
PICTURE_DPI = 150
SVG_LEFT_PX = 22  # more: the letters of its numbers are wider
MOST_NAMES = 6  # in a legend over the marks
MANY = 300  # points; an SVG has so many as a picture


def to_plotly(chart: Chart) -> "go.Figure":
    """The chart as an interactive figure with its legend, as wide as what shows it."""
    import plotly.graph_objects as go

    return go.Figure(figure(chart))


def to_svg(chart: Chart) -> str:
    """The chart as an SVG document; the same text for the same chart."""
    with matplotlib_style(chart.name):
        return save_svg(_drawn(chart), chart.name)


def write_svgs(folder: Path, charts: Iterable[Chart]) -> list[Path]:
    """Writes each chart as NAME.svg into a folder, which is made; returns the files."""
    written = []
    for chart in charts:
        written.append(folder / f"{chart.name}.svg")
        write_text(written[-1], to_svg(chart))
    return written


def write_picture(path: Path, chart: Chart) -> Path:
    """Writes the chart in the format of the path's suffix, and returns the path."""
    with matplotlib_style(chart.name), replacing(path) as temporary:
        _drawn(chart).savefig(temporary, dpi=PICTURE_DPI)
    return path


def _drawn(chart: Chart) -> "Figure":
    """The chart in the style that is set."""
    from matplotlib.figure import Figure

    size = layout_of(chart)
    width = size.width + SVG_LEFT_PX
    drawn = Figure(figsize=(width / PX_PER_INCH, size.height / PX_PER_INCH))
    drawn.subplots_adjust(
        left=(size.left + SVG_LEFT_PX) / width, right=1 - RIGHT_PX / width,
        bottom=size.bottom / size.height, top=1 - size.top / size.height,
        hspace=size.row_gap / size.panel_height, wspace=size.column_gap / size.panel_width,
    )  # fmt: skip
    shared = "col" if chart.shares_x else False
    grid = drawn.subplots(len(chart.rows), chart.columns, squeeze=False, sharex=shared)
    for axes, panel in zip(grid.flat, chart.panels, strict=True):
        if panel is None:
            axes.set_visible(False)
            continue
        if size.panel_width == CELL_PX:
            axes.locator_params(axis="x", nbins=2)
            axes.tick_params(labelsize=7)
        _draw_panel(axes, panel)
    handles, names = grid[0, 0].get_legend_handles_labels()
    named = dict(zip(names, handles, strict=True))  # each name once
    if 1 < len(named) <= MOST_NAMES:
        look = {"loc": "best", "handlelength": 1.4, "labelspacing": 0.25}
        grid[0, 0].legend(named.values(), named.keys(), **look)
    drawn.align_ylabels()
    return drawn


def _draw_panel(axes: "Axes", panel: Panel) -> None:
    axes.set(ylabel=panel.ylabel, xlabel=panel.xlabel, title=panel.title)
    for mark in panel.marks:
        _draw_mark(axes, mark)
    if panel.is_log_y:
        axes.set_yscale("log")
    axes.set(**{k: v for k, v in (("xlim", panel.xlim), ("ylim", panel.ylim)) if v})
    if not panel.has_y_ticks:
        axes.tick_params(labelleft=False, left=False)
    ink, on_top = palette()["ink"], axes.get_xaxis_transform()
    small = {"fontsize": 8, "alpha": 0.65, "transform": on_top}
    for start, end, colour, opacity in panel.spans:
        look = {"color": palette()[colour], "alpha": opacity}
        axes.axvspan(start, end, linewidth=0, zorder=0, **look)
    for x, name in panel.names:
        axes.text(x, 0.985, name, ha="center", va="top", **small)
    if panel.level is not None:
        axes.axhline(panel.level, color=ink, linewidth=0.6)
    if panel.divider is not None:
        axes.axvline(panel.divider[0], color=ink, linewidth=0.6, alpha=0.6)
        axes.text(panel.divider[0], 0.02, f" {panel.divider[1]}", **small)


def _draw_mark(axes: "Axes", mark: Mark) -> None:
    colour = palette()[mark.colour]
    look: dict[str, Any] = {"color": colour, "label": mark.name}
    if isinstance(mark, Boxes):
        raise TypeError("box plots are drawn on pages alone, whose figures can be saved there")
    look["alpha"] = mark.opacity
    match mark:
        case Band():
            axes.fill_between(mark.x, mark.low, mark.high, linewidth=0, **look)
        case Line():
            dash = (0, (4, 3)) if mark.is_dashed else "-"
            width = POINTS_PER_PX * mark.width_px
            axes.plot(mark.x, mark.y, linewidth=width, linestyle=dash, **look)
        case Points():
            look |= {
                "markersize": POINTS_PER_PX * mark.size_px, "rasterized": len(mark.x) > MANY,
                "markerfacecolor": "none" if mark.is_hollow else colour,
                "markeredgewidth": 0.7 if mark.is_hollow else 0, "linestyle": "", "marker": "o",
            }  # fmt: skip
            sd = None if mark.sd is None else 1.96 * np.asarray(mark.sd)
            axes.errorbar(mark.x, mark.y, sd, **look)
        case Bars():
            draw = axes.barh if mark.is_horizontal else axes.bar
            bars = draw(mark.x, mark.height, mark.width, **look)
            if mark.texts:
                axes.bar_label(bars, mark.texts, fontsize=8)
            if mark.is_horizontal:
                axes.yaxis.set_inverted(True)

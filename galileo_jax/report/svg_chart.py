"""A chart as an SVG document, for papers and slides."""

from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.report.chart import SHADED, Band, Chart, Dots, Line, Mark, Panel, is_named
from galileo_jax.report.figure import COLOURS, INK, PANEL_IN, style, to_svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes

HEX = {
    "object1": COLOURS[0], "object2": COLOURS[1], "object3": COLOURS[2], "ink": INK,
    "soft": "#6a6d76", "accent": COLOURS[0], "fails": "#d4a017",
}  # fmt: skip
POINTS = 0.72  # of a CSS pixel; a panel is 480 px of the page wide
STACKED_IN, EDGE_IN = 1.55, 0.3


def chart_svg(chart: Chart) -> str:
    """The same text for the same chart."""
    from matplotlib.figure import Figure

    count = len(chart.panels)
    width, height = PANEL_IN
    if count > 1:
        height = EDGE_IN + sum(
            STACKED_IN + EDGE_IN + (EDGE_IN if panel.xlabel else 0) for panel in chart.panels
        )
    with style(chart.name):
        figure = Figure(figsize=(width, height), layout="constrained" if count > 1 else None)
        if count == 1:  # laid out by hand: a fit has ten of them
            figure.subplots_adjust(0.165, 0.165, 0.98, 0.9)
        grid = figure.subplots(count, 1, squeeze=False, sharex=chart.shares_x)[:, 0]
        for axes, panel in zip(grid, chart.panels, strict=True):
            _draw(axes, panel)
        if len(chart.panels[0].marks) > 1:
            grid[0].legend(loc="best", handlelength=1.4, labelspacing=0.25)
        figure.align_ylabels()
        return to_svg(figure, chart.name)


def _draw(axes: "Axes", panel: Panel) -> None:
    axes.set(ylabel=panel.ylabel, xlabel=panel.xlabel, title=panel.title)
    for mark in panel.marks:
        _mark(axes, mark)
    if panel.xlim:
        axes.set_xlim(*panel.xlim)
    if panel.ylim:
        axes.set_ylim(*panel.ylim)
    if panel.at is not None:
        axes.axhline(panel.at, color=INK, linewidth=0.6)
    for phase in panel.phases:
        if phase.name in SHADED:
            axes.axvspan(phase.start_s, phase.end_s, color=INK, alpha=0.06, linewidth=0)
        if panel.xlim and is_named(phase, panel.xlim):
            axes.text(
                (phase.start_s + phase.end_s) / 2, 0.985, phase.name,
                transform=axes.get_xaxis_transform(), ha="center", va="top", fontsize=8, alpha=0.65,
            )  # fmt: skip
    if panel.stretch is not None:
        axes.axvspan(*panel.stretch, color=HEX["fails"], alpha=0.28, linewidth=0, zorder=0)


def _mark(axes: "Axes", mark: Mark) -> None:
    colour = HEX[mark.colour]
    match mark:
        case Band():
            axes.fill_between(
                mark.x, mark.low, mark.high, color=colour, alpha=mark.opacity, linewidth=0,
                label=mark.name,
            )  # fmt: skip
        case Line():
            axes.plot(
                mark.x, mark.y, color=colour, linewidth=POINTS * mark.width_px, label=mark.name,
                linestyle=(0, (4, 3)) if mark.is_dashed else "-",
            )  # fmt: skip
        case Dots():
            look = {
                "color": colour, "markersize": POINTS * mark.size_px, "markeredgewidth": 0.7,
                "markerfacecolor": "none" if mark.is_hollow else colour, "label": mark.name,
            }  # fmt: skip
            if mark.sd is None:
                axes.plot(mark.x, mark.y, "o", **look)
            else:
                axes.errorbar(mark.x, mark.y, 1.96 * np.asarray(mark.sd), fmt="o", **look)

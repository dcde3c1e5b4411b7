"""Draws a `Chart`: as a Plotly figure for pages and notebooks, as SVG for papers and slides.

Two libraries, because neither does both: Plotly's figures are interactive and need no network,
but their still pictures need Chrome; Matplotlib's SVG needs nothing. Both follow one `_Layout`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from html import escape
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.report.chart import (
    SHADED_PHASES,
    Band,
    Bars,
    Boxes,
    Chart,
    Line,
    Mark,
    Matrix,
    Panel,
    Points,
    Values,
    is_named,
)
from galileo_jax.report.style import matplotlib_style, palette, save_svg

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from matplotlib.axes import Axes

TITLE_PX, PLAIN_PX, LABEL_PX, END_PX, LEFT_PX, RIGHT_PX = 30, 12, 46, 26, 58, 12
ALONE_PX, STACKED_PX, PANEL_PX, CELL_PX = 210, 150, 410, 100
LETTER_PX, SLANTED_PX, LEGEND_PX = 6.5, 4.5, 40
PX_PER_INCH, POINTS_PER_PX = 100, 0.72
MOST_NAMES = 6  # in a legend over the marks


@dataclass(frozen=True)
class _Layout:
    """Sizes in px: margins, gaps between panels, the panels."""

    top: float
    bottom: float
    left: float
    row_gap: float
    column_gap: float
    panel_height: float
    panel_width: float
    rows: int
    columns: int

    @property
    def height(self) -> float:
        return self.top + self.inner_height + self.bottom

    @property
    def inner_height(self) -> float:
        return self.rows * self.panel_height + (self.rows - 1) * self.row_gap

    @property
    def width(self) -> float:
        inner = self.columns * self.panel_width + (self.columns - 1) * self.column_gap
        return self.left + inner + RIGHT_PX


def _layout(chart: Chart) -> _Layout:
    first, *lower = chart.rows
    marks = [mark for panel in chart.panels if panel for mark in panel.marks]
    beside = [panel for row in chart.rows for panel in row[1:] if panel]
    is_narrow = bool(beside) and not any(panel.has_y_ticks for panel in beside)
    below = any(panel and panel.title for row in lower for panel in row)
    row_gap = PLAIN_PX if chart.shares_x else LABEL_PX + (TITLE_PX if below else PLAIN_PX)
    on_x = max((len(name) for mark in marks for name in _categories(mark)[0]), default=0)
    on_y = max((len(name) for mark in marks for name in _categories(mark)[1]), default=0)
    bottom = LABEL_PX if any(panel and panel.xlabel for panel in chart.rows[-1]) else END_PX
    usual = ALONE_PX if len(chart.rows) == 1 else STACKED_PX
    return _Layout(
        top=TITLE_PX if any(panel and panel.title for panel in first) else PLAIN_PX,
        bottom=bottom + (SLANTED_PX * on_x if _is_slanted(marks) else 0),
        left=max(LEFT_PX, LETTER_PX * on_y),
        row_gap=row_gap,
        column_gap=PLAIN_PX if is_narrow else LEFT_PX + RIGHT_PX,
        panel_height=chart.panel_px or usual,
        panel_width=CELL_PX if is_narrow else PANEL_PX,
        rows=len(chart.rows),
        columns=chart.columns,
    )


def _categories(mark: Mark) -> tuple[list[str], list[str]]:
    """The categories on the x and on the y axis."""
    match mark:
        case Matrix():
            return list(mark.columns), list(mark.rows)
        case Bars() if mark.is_horizontal:
            return [], _names(mark.x)
        case Band():
            return [], []
        case _:
            return _names(mark.x), []


def _names(values: Values) -> list[str]:
    return list(dict.fromkeys(value for value in values if isinstance(value, str)))


def _is_slanted(marks: Sequence[Mark]) -> bool:
    """Whether the categories on x have no room side by side."""
    names = {name for mark in marks for name in _categories(mark)[0]}
    return sum(map(len, names)) * LETTER_PX > PANEL_PX


# ---- Plotly


def to_plotly(chart: Chart, has_legend: bool = True) -> "go.Figure":
    """The chart as an interactive figure, as wide as what shows it.

    Args:
      chart: what is drawn.
      has_legend: whether the figure itself says what the marks mean.
    """
    from plotly.subplots import make_subplots

    size = _layout(chart)
    legend_px = LEGEND_PX if has_legend else 0
    figure = make_subplots(
        rows=size.rows,
        cols=size.columns,
        specs=[[{} if panel else None for panel in row] for row in chart.rows],
        shared_xaxes=chart.shares_x and size.rows > 1,
        vertical_spacing=size.row_gap / size.inner_height,
        horizontal_spacing=size.column_gap / size.width,
    )
    named: set[tuple[str, str]] = set()
    for i, panels in enumerate(chart.rows, 1):
        for j, panel in enumerate(panels, 1):
            if panel is None:
                continue
            for mark in panel.marks:
                trace = _trace(mark)
                key = (mark.name, mark.colour)
                trace.showlegend = bool(mark.name) and key not in named
                trace.legendgroup = f"{mark.name} {mark.colour}"
                named.add(key)
                figure.add_trace(trace, i, j)
            _set_axes(figure, panel, i, j)
            _annotate(figure, panel, i, j)
    marks = [mark for panel in chart.panels if panel for mark in panel.marks]
    if _is_slanted(marks):
        figure.update_xaxes(tickangle=-35)
    if size.panel_width == CELL_PX:
        figure.update_xaxes(nticks=3, tickangle=0, tickfont={"size": 10})
    is_grouped = any(isinstance(mark, Boxes) and mark.offset for mark in marks)
    figure.update_layout(
        template=_template(),
        height=round(size.height + legend_px),
        margin={"l": size.left, "r": RIGHT_PX, "t": size.top, "b": size.bottom + legend_px},
        showlegend=has_legend and len(named) > 1,
        barmode="overlay",
        boxmode="group" if is_grouped else "overlay",
    )
    return figure


def _rgba(colour: str, opacity: float = 1.0) -> str:
    """A colour of the palette; page.js exchanges it for that of dark pages."""
    red, green, blue = (int(palette()[colour][i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


@cache
def _template() -> "go.layout.Template":
    """The look of all figures."""
    import plotly.graph_objects as go

    axis = {
        "linecolor": _rgba("soft"), "tickcolor": _rgba("soft"), "gridcolor": _rgba("line"),
        "zeroline": False, "ticklen": 4, "tickfont": {"color": _rgba("soft")},
        "title": {"font": {"color": _rgba("soft"), "size": 12}, "standoff": 8},
        "hoverformat": ".4g", "automargin": False,
    }  # fmt: skip
    return go.layout.Template(
        layout={
            "font": {"family": "sans-serif", "size": 12, "color": _rgba("ink")},
            "paper_bgcolor": _rgba("paper"),
            "plot_bgcolor": _rgba("paper", 0),
            "hovermode": "closest",
            "hoverlabel": {"bgcolor": _rgba("card"), "font": {"color": _rgba("ink")}},
            "legend": {"orientation": "h", "x": 0, "y": 0, "yref": "container",
                       "yanchor": "bottom"},
            "xaxis": {**axis, "ticks": "outside", "showgrid": False, "showline": True, "nticks": 7},
            "yaxis": {**axis, "ticks": "", "nticks": 5},
        }
    )  # fmt: skip


def _numbers(values: Values) -> Any:
    """For Plotly: short floats, which four figures of hover text do not show; or escaped names."""
    if _names(values):
        return [escape(str(value)) for value in values]
    return np.asarray(values, np.float32)


def _trace(mark: Mark) -> Any:
    import plotly.graph_objects as go

    name = escape(mark.name)
    match mark:
        case Band():
            known = np.isfinite(mark.x) & np.isfinite(mark.low) & np.isfinite(mark.high)
            x, low, high = (np.asarray(v)[known] for v in (mark.x, mark.low, mark.high))
            return go.Scatter(
                x=_numbers(np.concatenate([x, x[::-1]])),
                y=_numbers(np.concatenate([low, high[::-1]])),
                mode="lines", fill="toself", fillcolor=_rgba(mark.colour, mark.opacity),
                line={"width": 0}, hoverinfo="skip", name=name,
            )  # fmt: skip
        case Line():
            look = {
                "color": _rgba(mark.colour, mark.opacity),
                "width": mark.width_px,
                "dash": "dash" if mark.is_dashed else "solid",
            }
            x, y = _numbers(mark.x), _numbers(mark.y)
            return go.Scatter(x=x, y=y, mode="lines", line=look, name=name)
        case Points():
            error = None
            if mark.sd is not None:
                error = {
                    "type": "data", "array": _numbers(1.96 * np.asarray(mark.sd)),
                    "color": _rgba(mark.colour, 0.4), "thickness": 1, "width": 0,
                }  # fmt: skip
            look = {
                "color": _rgba(mark.colour, mark.opacity),
                "size": mark.size_px,
                "symbol": "circle-open" if mark.is_hollow else "circle",
            }
            x, y = _numbers(mark.x), _numbers(mark.y)
            return go.Scatter(x=x, y=y, mode="markers", marker=look, error_y=error, name=name)
        case Bars():
            ends = _numbers(mark.x), _numbers(mark.height)
            x, y = reversed(ends) if mark.is_horizontal else ends
            return go.Bar(
                x=x, y=y, width=mark.width, orientation="h" if mark.is_horizontal else "v",
                marker={"color": _rgba(mark.colour, mark.opacity), "line": {"width": 0}},
                text=mark.texts or None, textposition="outside", cliponaxis=False, name=name,
            )  # fmt: skip
        case Boxes():
            return go.Box(
                x=_numbers(mark.x), y=_numbers(mark.y), boxpoints="all", jitter=0.5, pointpos=0,
                marker={"color": _rgba(mark.colour), "size": 4}, line={"width": 1},
                fillcolor=_rgba(mark.colour, 0.15), name=name,
            )  # fmt: skip
        case Matrix():
            return go.Heatmap(
                x=_numbers(mark.columns), y=_numbers(mark.rows), z=mark.values,
                text=[[f"{n:g}" if n else "" for n in row] for row in mark.values],
                texttemplate="%{text}", showscale=False, xgap=1, ygap=1, name=name,
                colorscale=[[0, _rgba("card")], [1, _rgba(mark.colour)]],
            )  # fmt: skip


def _set_axes(figure: "go.Figure", panel: Panel, row: int, column: int) -> None:
    each = {"type": "category", "tickmode": "linear", "dtick": 1}
    on_x, on_y = zip(*map(_categories, panel.marks), strict=True)
    is_flipped = any(on_y)  # categories are read from the top down
    figure.update_xaxes(
        title_text=escape(panel.xlabel), range=panel.xlim, row=row, col=column,
        **(each if any(on_x) else {}),
    )  # fmt: skip
    limits = np.log10(panel.ylim) if panel.ylim and panel.is_log_y else panel.ylim
    figure.update_yaxes(
        title_text=escape(panel.ylabel), range=limits, row=row, col=column,
        type="log" if panel.is_log_y else None, showticklabels=panel.has_y_ticks,
        showgrid=panel.has_y_ticks,
        **({**each, "autorange": "reversed"} if is_flipped else {}),
    )  # fmt: skip


def _annotate(figure: "go.Figure", panel: Panel, row: int, column: int) -> None:
    """Title, phases, the time that is highlighted, the level and the divider."""
    at: dict[str, Any] = {"row": row, "col": column}
    within = {"yref": "y domain", "showarrow": False, **at}
    small = {"size": 11, "color": _rgba("soft")}
    for phase in panel.phases:
        if phase.name in SHADED_PHASES:
            figure.add_vrect(phase.start_s, phase.end_s, fillcolor=_rgba("ink", 0.06),
                             line_width=0, layer="below", **at)  # fmt: skip
        if panel.xlim and is_named(phase, panel.xlim):
            figure.add_annotation(
                x=(phase.start_s + phase.end_s) / 2, y=1, yanchor="top", text=escape(phase.name),
                font=small, **within,
            )  # fmt: skip
    if panel.highlight is not None:
        start, end = panel.highlight
        figure.add_vrect(start, end, fillcolor=_rgba("fails", 0.3), line_width=0, layer="below",
                         **at)  # fmt: skip
    if panel.level is not None:
        figure.add_hline(panel.level, line={"color": _rgba("soft"), "width": 1}, **at)
    if panel.divider is not None:
        x, name = panel.divider
        figure.add_vline(x, line={"color": _rgba("soft"), "width": 1}, **at)
        figure.add_annotation(x=x, y=0, xanchor="left", yanchor="bottom", text=escape(name),
                              font=small, **within)  # fmt: skip
    if panel.title:
        figure.add_annotation(
            xref="x domain", x=0, y=1, yshift=20, xanchor="left", yanchor="middle",
            text=escape(panel.title), font={"size": 13}, **within,
        )  # fmt: skip


# ---- Matplotlib


def to_svg(chart: Chart) -> str:
    """The chart as an SVG document; the same text for the same chart."""
    from matplotlib.figure import Figure

    size = _layout(chart)
    with matplotlib_style(chart.name):
        figure = Figure(figsize=(size.width / PX_PER_INCH, size.height / PX_PER_INCH))
        figure.subplots_adjust(
            left=size.left / size.width, right=1 - RIGHT_PX / size.width,
            bottom=size.bottom / size.height, top=1 - size.top / size.height,
            hspace=size.row_gap / size.panel_height, wspace=size.column_gap / size.panel_width,
        )  # fmt: skip
        grid = figure.subplots(
            size.rows, size.columns, squeeze=False, sharex="col" if chart.shares_x else False
        )
        for axes, panel in zip(grid.flat, chart.panels, strict=True):
            if panel is None:
                axes.set_visible(False)
            else:
                _draw_panel(axes, panel, is_small=size.panel_width == CELL_PX)
        names = {mark.name for panel in chart.panels if panel for mark in panel.marks if mark.name}
        if 1 < len(names) <= MOST_NAMES:
            grid[0, 0].legend(loc="best", handlelength=1.4, labelspacing=0.25)
        figure.align_ylabels()
        return save_svg(figure, chart.name)


def _draw_panel(axes: "Axes", panel: Panel, is_small: bool) -> None:
    axes.set(ylabel=panel.ylabel, xlabel=panel.xlabel, title=panel.title)
    for mark in panel.marks:
        _draw_mark(axes, mark)
    if panel.is_log_y:
        axes.set_yscale("log")
    if panel.xlim:
        axes.set_xlim(*panel.xlim)
    if panel.ylim:
        axes.set_ylim(*panel.ylim)
    if not panel.has_y_ticks:
        axes.tick_params(labelleft=False, left=False)
    if is_small:
        axes.locator_params(axis="x", nbins=2)
    if _is_slanted(panel.marks):
        axes.tick_params(axis="x", rotation=35)
        for label in axes.get_xticklabels():
            label.set(ha="right", rotation_mode="anchor")
    ink, small = palette()["ink"], {"fontsize": 8, "alpha": 0.65}
    if panel.level is not None:
        axes.axhline(panel.level, color=ink, linewidth=0.6)
    for phase in panel.phases:
        if phase.name in SHADED_PHASES:
            axes.axvspan(phase.start_s, phase.end_s, color=ink, alpha=0.06, linewidth=0)
        if panel.xlim and is_named(phase, panel.xlim):
            axes.text(
                (phase.start_s + phase.end_s) / 2, 0.985, phase.name, ha="center", va="top",
                transform=axes.get_xaxis_transform(), **small,
            )  # fmt: skip
    if panel.highlight is not None:
        axes.axvspan(*panel.highlight, color=palette()["fails"], alpha=0.28, linewidth=0, zorder=0)
    if panel.divider is not None:
        x, name = panel.divider
        axes.axvline(x, color=ink, linewidth=0.6, alpha=0.6)
        axes.text(x, 0.02, f" {name}", transform=axes.get_xaxis_transform(), **small)


def _draw_mark(axes: "Axes", mark: Mark) -> None:
    colour = palette()[mark.colour]
    match mark:
        case Band():
            axes.fill_between(
                mark.x, mark.low, mark.high, color=colour, alpha=mark.opacity, linewidth=0,
                label=mark.name,
            )  # fmt: skip
        case Line():
            axes.plot(
                mark.x, mark.y, color=colour, linewidth=POINTS_PER_PX * mark.width_px,
                linestyle=(0, (4, 3)) if mark.is_dashed else "-", alpha=mark.opacity,
                label=mark.name,
            )  # fmt: skip
        case Points():
            look = {
                "color": colour, "markersize": POINTS_PER_PX * mark.size_px, "label": mark.name,
                "markerfacecolor": "none" if mark.is_hollow else colour, "alpha": mark.opacity,
                "markeredgewidth": 0.7 if mark.is_hollow else 0,
            }  # fmt: skip
            if mark.sd is None:
                axes.plot(mark.x, mark.y, "o", **look)
            else:
                axes.errorbar(mark.x, mark.y, 1.96 * np.asarray(mark.sd), fmt="o", **look)
        case Bars():
            draw = axes.barh if mark.is_horizontal else axes.bar
            bars = draw(mark.x, mark.height, mark.width, color=colour, alpha=mark.opacity,
                        label=mark.name)  # fmt: skip
            if mark.texts:
                axes.bar_label(bars, mark.texts, fontsize=8)
            if mark.is_horizontal and not axes.yaxis_inverted():
                axes.invert_yaxis()
        case Boxes():
            _draw_boxes(axes, mark, colour)
        case Matrix():
            axes.pcolormesh(mark.values, cmap=_shades(colour), edgecolor="white")
            axes.set_xticks(np.arange(len(mark.columns)) + 0.5, mark.columns)
            axes.set_yticks(np.arange(len(mark.rows)) + 0.5, mark.rows)
            axes.invert_yaxis()
            for row, column in np.argwhere(mark.values):
                text = f"{mark.values[row, column]:g}"
                axes.text(column + 0.5, row + 0.5, text, ha="center", va="center")


def _draw_boxes(axes: "Axes", mark: Boxes, colour: str) -> None:
    names = _names(mark.x)
    axes.plot(names, np.full(len(names), np.nan))  # puts the categories on the axis
    places = axes.convert_xunits(names)
    values = [[y for x, y in zip(mark.x, mark.y, strict=True) if x == name] for name in names]
    axes.boxplot(
        values, positions=np.asarray(places) + mark.offset, widths=0.8 * mark.width,
        manage_ticks=False, patch_artist=True, label=mark.name, flierprops={"marker": ""},
        boxprops={"facecolor": colour, "alpha": 0.3}, medianprops={"color": colour},
    )  # fmt: skip
    points = list(chain.from_iterable(values))
    at = np.repeat(places, [len(some) for some in values]) + mark.offset
    axes.plot(at, points, "o", color=colour, markersize=3, markeredgewidth=0)


def _shades(colour: str) -> Any:
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list(colour, ["white", colour])

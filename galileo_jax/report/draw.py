"""Draws a `Chart`: as a Plotly figure for pages and notebooks, as SVG for papers and slides.

Two libraries, because neither does both: Plotly's figures are interactive and need no network,
but its still pictures need Chrome; Matplotlib's SVG needs nothing. Both follow one `_Layout`.
"""

from dataclasses import dataclass
from functools import cache
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from galileo_jax.report.chart import Band, Bars, Boxes, Chart, Line, Mark, Panel, Points, Values
from galileo_jax.report.style import matplotlib_style, palette, save_svg

if TYPE_CHECKING:
    import plotly.graph_objects as go
    from matplotlib.axes import Axes

TITLE_PX, PLAIN_PX, LABEL_PX, END_PX, LEFT_PX, RIGHT_PX = 30, 12, 46, 26, 58, 12
ALONE_PX, STACKED_PX, PANEL_PX, CELL_PX = 210, 150, 410, 100
LEGEND_PX, LEGEND_WIDTH_PX = 40, 800  # of one line
LETTER_PX, SLANTED_PX, SLANT_DEG = 6.5, 4.5, 35  # of the names of categories
PX_PER_INCH, POINTS_PER_PX = 100, 0.72
SVG_LEFT_PX = 22  # more: the letters of its numbers are wider
MOST_NAMES = 6  # in a legend over the marks
MANY = 300  # points; an SVG has so many as a picture


@dataclass(frozen=True)
class _Layout:
    """Sizes in px: the figure, its margins, the gaps between panels, the panels."""

    width: float
    height: float
    top: float
    bottom: float
    left: float
    row_gap: float
    column_gap: float
    panel_width: float
    panel_height: float


def _layout(chart: Chart) -> _Layout:
    first, *lower = chart.rows
    beside = [panel for row in chart.rows for panel in row[1:] if panel]
    is_narrow = bool(beside) and not any(panel.has_y_ticks for panel in beside)
    column_gap = PLAIN_PX if is_narrow else LEFT_PX + RIGHT_PX
    panel_width = CELL_PX if is_narrow else PANEL_PX
    lower_top = TITLE_PX if any(p and p.title for row in lower for p in row) else PLAIN_PX
    row_gap = lower_top if chart.shares_x else LABEL_PX + lower_top
    panel_height = chart.panel_px or (STACKED_PX if lower else ALONE_PX)
    marks = chart.marks
    on_x = [len(name) for mark in marks if isinstance(mark, Boxes) for name in mark.x]
    on_y = [len(str(x)) for mark in marks if isinstance(mark, Bars) and mark.is_horizontal
            for x in mark.x]  # fmt: skip
    top = TITLE_PX if any(panel and panel.title for panel in first) else PLAIN_PX
    bottom = LABEL_PX if any(panel and panel.xlabel for panel in chart.rows[-1]) else END_PX
    bottom += SLANTED_PX * max(on_x, default=0)
    left = max(LEFT_PX, LETTER_PX * max(on_y, default=0))
    rows, columns = len(chart.rows), chart.columns
    return _Layout(
        width=left + columns * (panel_width + column_gap) - column_gap + RIGHT_PX,
        height=top + rows * (panel_height + row_gap) - row_gap + bottom,
        top=top,
        bottom=bottom,
        left=left,
        row_gap=row_gap,
        column_gap=column_gap,
        panel_width=panel_width,
        panel_height=panel_height,
    )


# ---- Plotly


def to_plotly(chart: Chart, has_legend: bool = True) -> "go.Figure":
    """The chart as an interactive figure, as wide as what shows it.

    Args:
      chart: what is drawn.
      has_legend: whether the figure itself says what the marks mean.
    """
    from plotly.subplots import make_subplots

    size = _layout(chart)
    figure = make_subplots(
        rows=len(chart.rows),
        cols=chart.columns,
        specs=[[{} if panel else None for panel in row] for row in chart.rows],
        shared_xaxes=chart.shares_x,
        vertical_spacing=size.row_gap / (size.height - size.top - size.bottom),
        horizontal_spacing=size.column_gap / size.width,
    )
    named: set[str] = set()
    for i, panels in enumerate(chart.rows, 1):
        for j, panel in enumerate(panels, 1):
            for mark in panel.marks if panel else ():
                trace, group = _trace(mark), f"{mark.name} {mark.colour}"
                trace.update(legendgroup=group, showlegend=bool(mark.name) and group not in named)
                named.add(group)
                figure.add_trace(trace, i, j)
            if panel:
                _furnish(figure, panel, {"row": i, "col": j})
    if size.panel_width == CELL_PX:
        figure.update_xaxes(nticks=3, tickangle=0, tickfont={"size": 10})
    letters_px = sum(LETTER_PX * len(group) for group in named)
    legend_px = LEGEND_PX * (1 + letters_px // LEGEND_WIDTH_PX) if has_legend else 0
    is_grouped = any(isinstance(mark, Boxes) and mark.offset for mark in chart.marks)
    return figure.update_layout(
        template=_template(),
        height=round(size.height + legend_px),
        margin={"l": size.left, "r": RIGHT_PX, "t": size.top, "b": size.bottom + legend_px},
        showlegend=has_legend and len(named) > 1,
        barmode="overlay",
        boxmode="group" if is_grouped else "overlay",
    )


def _rgba(colour: str, opacity: float = 1.0) -> str:
    """A colour of the palette; page.js exchanges it for that of dark pages."""
    red, green, blue = bytes.fromhex(palette()[colour][1:])
    return f"rgba({red},{green},{blue},{opacity:g})"


@cache
def _template() -> "go.layout.Template":
    """The look of all figures."""
    import plotly.graph_objects as go

    soft = _rgba("soft")
    axis = {
        "linecolor": soft, "tickcolor": soft, "gridcolor": _rgba("line"), "zeroline": False,
        "ticklen": 4, "tickfont": {"color": soft}, "hoverformat": ".4g", "automargin": False,
        "title": {"font": {"color": soft, "size": 12}, "standoff": 8},
    }  # fmt: skip
    return go.layout.Template(layout={
        "font": {"family": "sans-serif", "size": 12, "color": _rgba("ink")},
        "paper_bgcolor": _rgba("paper"), "plot_bgcolor": _rgba("paper", 0),
        "hovermode": "closest",
        "hoverlabel": {"bgcolor": _rgba("card"), "font": {"color": _rgba("ink")}},
        "legend": {"orientation": "h", "x": 0, "y": 0, "yref": "container", "yanchor": "bottom"},
        "xaxis": {**axis, "ticks": "outside", "showgrid": False, "showline": True, "nticks": 7},
        "yaxis": {**axis, "ticks": "", "nticks": 5},
    })  # fmt: skip


def _values(values: Values) -> Any:
    """Escaped names, or short floats: hover texts have four figures."""
    if isinstance(values[0] if len(values) else 0, str):
        return [escape(str(value)) for value in values]
    return np.asarray(values, np.float32)


def _trace(mark: Mark) -> Any:
    import plotly.graph_objects as go

    name, colour = escape(mark.name), _rgba(mark.colour, getattr(mark, "opacity", 1.0))
    if isinstance(mark, Band):
        known = np.isfinite(mark.x) & np.isfinite(mark.low) & np.isfinite(mark.high)
        x, low, high = (np.asarray(v)[known] for v in (mark.x, mark.low, mark.high))
        return go.Scatter(
            x=_values(np.concatenate([x, x[::-1]])), y=_values(np.concatenate([low, high[::-1]])),
            mode="lines", fill="toself", fillcolor=colour, line={"width": 0}, hoverinfo="skip",
            name=name,
        )  # fmt: skip
    if isinstance(mark, Bars):
        x, y = _values(mark.x), _values(mark.height)
        return go.Bar(
            x=y if mark.is_horizontal else x, y=x if mark.is_horizontal else y, width=mark.width,
            orientation="h" if mark.is_horizontal else "v",
            marker={"color": colour, "line_width": 0}, text=mark.texts or None,
            textposition="outside", cliponaxis=False, name=name,
        )  # fmt: skip
    places = {"x": _values(mark.x), "y": _values(mark.y), "name": name}
    if isinstance(mark, Line):
        dash = "dash" if mark.is_dashed else "solid"
        look = {"color": colour, "width": mark.width_px, "dash": dash}
        return go.Scatter(mode="lines", line=look, **places)
    if isinstance(mark, Boxes):
        return go.Box(
            boxpoints="all", jitter=0.5, pointpos=0, marker={"color": colour, "size": 4},
            line={"width": 1}, fillcolor=_rgba(mark.colour, 0.15), **places,
        )  # fmt: skip
    if mark.sd is not None:
        places["error_y"] = {"array": _values(1.96 * np.asarray(mark.sd)), "thickness": 1,
                             "color": _rgba(mark.colour, 0.4), "width": 0}  # fmt: skip
    symbol = "circle-open" if mark.is_hollow else "circle"
    look = {"color": colour, "size": mark.size_px, "symbol": symbol}
    return go.Scatter(mode="markers", marker=look, **places)


def _furnish(figure: "go.Figure", panel: Panel, at: dict[str, Any]) -> None:
    """Axes, title, and what is shaded, named or ruled in a panel."""
    each = {"type": "category", "tickmode": "linear", "dtick": 1}
    on_x = each | {"tickangle": -SLANT_DEG} if isinstance(panel.marks[0], Boxes) else {}
    is_flipped = isinstance(panel.marks[0], Bars) and panel.marks[0].is_horizontal
    on_y = each | {"autorange": "reversed"} if is_flipped else {}
    if panel.is_log_y:
        on_y = {"type": "log"}
    figure.update_xaxes(title_text=escape(panel.xlabel), range=panel.xlim, **on_x, **at)
    figure.update_yaxes(
        title_text=escape(panel.ylabel), range=panel.ylim, showgrid=panel.has_y_ticks,
        showticklabels=panel.has_y_ticks, **on_y, **at,
    )  # fmt: skip
    for start, end, colour, opacity in panel.spans:
        look = {"fillcolor": _rgba(colour, opacity), "line_width": 0, "layer": "below"}
        figure.add_vrect(start, end, **look, **at)
    ruled = {"line": {"color": _rgba("soft"), "width": 1}, **at}
    if panel.level is not None:
        figure.add_hline(panel.level, **ruled)
    text = {"yref": "y domain", "showarrow": False, "font": {"size": 11, "color": _rgba("soft")}}
    for x, name in panel.names:
        figure.add_annotation(x=x, y=1, yanchor="top", text=escape(name), **text, **at)
    if panel.divider is not None:
        x, name = panel.divider
        figure.add_vline(x, **ruled)
        corner = {"x": x, "y": 0, "xanchor": "left", "yanchor": "bottom"}
        figure.add_annotation(text=escape(name), **corner, **text, **at)
    if panel.title:
        corner = {"xref": "x domain", "x": 0, "y": 1, "yshift": 20, "xanchor": "left"}
        text["font"] = {"size": 13}
        figure.add_annotation(text=escape(panel.title), yanchor="middle", **corner, **text, **at)


# ---- Matplotlib


def to_svg(chart: Chart) -> str:
    """The chart as an SVG document; the same text for the same chart."""
    from matplotlib.figure import Figure

    size = _layout(chart)
    width = size.width + SVG_LEFT_PX
    with matplotlib_style(chart.name):
        figure = Figure(figsize=(width / PX_PER_INCH, size.height / PX_PER_INCH))
        figure.subplots_adjust(
            left=(size.left + SVG_LEFT_PX) / width, right=1 - RIGHT_PX / width,
            bottom=size.bottom / size.height, top=1 - size.top / size.height,
            hspace=size.row_gap / size.panel_height, wspace=size.column_gap / size.panel_width,
        )  # fmt: skip
        shared = "col" if chart.shares_x else False
        grid = figure.subplots(len(chart.rows), chart.columns, squeeze=False, sharex=shared)
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
        figure.align_ylabels()
        return save_svg(figure, chart.name)


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
        _draw_boxes(axes, mark, colour)
        return
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


def _draw_boxes(axes: "Axes", mark: Boxes, colour: str) -> None:
    names = list(dict.fromkeys(mark.x))
    axes.plot(names, np.full(len(names), np.nan))  # puts the categories on the axis
    places = np.asarray(axes.convert_xunits(names)) + mark.offset
    values = [[y for x, y in zip(mark.x, mark.y, strict=True) if x == name] for name in names]
    axes.boxplot(
        values, positions=places, widths=0.8 * mark.width, manage_ticks=False, patch_artist=True,
        flierprops={"marker": ""}, medianprops={"color": colour}, label=mark.name,
        boxprops={"facecolor": colour, "alpha": 0.3},
    )  # fmt: skip
    for place, some in zip(places, values, strict=True):
        axes.plot([place] * len(some), some, "o", color=colour, markersize=3, markeredgewidth=0)
    axes.tick_params(axis="x", rotation=SLANT_DEG)

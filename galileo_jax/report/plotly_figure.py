"""A `Chart` as a Plotly figure, as plain JSON: Plotly's own objects take 20 times as long to make.

`go.Figure(figure(chart))` checks it, where a notebook asks for an object.
"""

import base64
import json
from html import escape
from typing import Any

import numpy as np

from galileo_jax.report.chart import (
    CELL_PX,
    LETTER_PX,
    RIGHT_PX,
    SLANT_DEG,
    Band,
    Bars,
    Boxes,
    Chart,
    Layout,
    Line,
    Mark,
    Panel,
    Values,
    layout_of,
)
from galileo_jax.report.style import palette

LEGEND_PX, LEGEND_WIDTH_PX = 40, 800  # of one line


def figure(chart: Chart, has_legend: bool = True) -> dict[str, Any]:
    """`data` and `layout`, with NumPy arrays in them, as wide as what shows it.

    `has_legend`: whether the figure itself says what the marks mean.
    """
    size, data, named = layout_of(chart), [], set[str]()
    layout: dict[str, Any] = {"shapes": [], "annotations": []}
    last_row = len(chart.panels) - chart.columns
    for index, panel in enumerate(chart.panels):
        if panel is None:
            continue
        end = str(index + 1) if index else ""
        for mark in panel.marks:
            group = f"{mark.name} {mark.colour}"
            shown = bool(mark.name) and group not in named
            named.add(group)
            on = {"xaxis": f"x{end}", "yaxis": f"y{end}"}
            data.append(_trace(mark) | {"legendgroup": group, "showlegend": shown} | on)
        x_axis, y_axis = _axes(panel, size)
        if chart.shares_x and index < last_row:
            below = last_row + index % chart.columns
            x_axis |= {"matches": f"x{below + 1}", "showticklabels": False}
        layout |= {f"xaxis{end}": x_axis, f"yaxis{end}": y_axis}
        _furnish(layout, panel, end)
    letters_px = sum(LETTER_PX * len(group) for group in named)
    legend_px = LEGEND_PX * (1 + letters_px // LEGEND_WIDTH_PX) if has_legend else 0
    is_grouped = any(isinstance(mark, Boxes) and mark.is_beside for mark in chart.marks)
    layout |= {
        "template": _template(),
        "grid": {
            "rows": len(chart.rows), "columns": chart.columns, "pattern": "independent",
            "xgap": size.column_gap / (size.column_gap + size.panel_width),
            "ygap": size.row_gap / (size.row_gap + size.panel_height),
        },
        "height": round(size.height + legend_px),
        "margin": {"l": size.left, "r": RIGHT_PX, "t": size.top, "b": size.bottom + legend_px},
        "showlegend": has_legend and len(named) > 1,
        "barmode": "overlay",
        "boxmode": "group" if is_grouped else "overlay",
    }  # fmt: skip
    return {"data": data, "layout": layout}


def to_json(drawn: dict[str, Any]) -> str:
    """A figure as Plotly's script reads it: arrays as base64 of their bytes."""

    def encoded(value: Any) -> Any:
        array = np.ascontiguousarray(value)
        kind = array.dtype.newbyteorder("<")
        return {
            "dtype": kind.str[1:],
            "bdata": base64.b64encode(array.astype(kind).tobytes()).decode("ascii"),
        }

    return json.dumps(drawn, default=encoded, separators=(",", ":"))


def dark(drawn: Any) -> Any:
    """A figure, or a part of one, in the colours of dark pages, as page.js paints it."""
    if isinstance(drawn, dict):
        return {key: dark(part) for key, part in drawn.items()}
    if isinstance(drawn, list):
        return [dark(part) for part in drawn]
    if isinstance(drawn, str) and drawn.startswith("rgba("):
        plain, _, opacity = drawn.rpartition(",")
        others = {_rgb(name): _rgb(name, is_dark=True) for name in palette()}
        return f"{others.get(plain, plain)},{opacity}"
    return drawn


def _rgb(colour: str, is_dark: bool = False) -> str:
    red, green, blue = bytes.fromhex(palette(is_dark)[colour][1:])
    return f"rgba({red},{green},{blue}"


def _rgba(colour: str, opacity: float = 1.0) -> str:
    """A colour of the palette; page.js and `dark` exchange it for that of dark pages."""
    return f"{_rgb(colour)},{opacity:g})"


def _template() -> dict[str, Any]:
    """The look of all figures."""
    soft = _rgba("soft")
    axis = {
        "linecolor": soft, "tickcolor": soft, "gridcolor": _rgba("line"), "zeroline": False,
        "ticklen": 4, "tickfont": {"color": soft}, "hoverformat": ".4g", "automargin": False,
        "title": {"font": {"color": soft, "size": 12}, "standoff": 8},
    }  # fmt: skip
    return {"layout": {
        "font": {"family": "sans-serif", "size": 12, "color": _rgba("ink")},
        "paper_bgcolor": _rgba("paper"), "plot_bgcolor": _rgba("paper", 0),
        "hovermode": "closest",
        "hoverlabel": {"bgcolor": _rgba("card"), "font": {"color": _rgba("ink")}},
        "legend": {"orientation": "h", "x": 0, "y": 0, "yref": "container", "yanchor": "bottom"},
        "xaxis": {**axis, "ticks": "outside", "showgrid": False, "showline": True, "nticks": 7},
        "yaxis": {**axis, "ticks": "", "nticks": 5, "exponentformat": "none"},
    }}  # fmt: skip


def _values(values: Values) -> Any:
    """Escaped names, or short floats: hover texts have four figures."""
    if isinstance(values[0] if len(values) else 0, str):
        return [escape(str(value)) for value in values]
    return np.asarray(values, np.float32)


def _trace(mark: Mark) -> dict[str, Any]:
    name, colour = escape(mark.name), _rgba(mark.colour, getattr(mark, "opacity", 1.0))
    if isinstance(mark, Band):
        known = np.isfinite(mark.x) & np.isfinite(mark.low) & np.isfinite(mark.high)
        x, low, high = (np.asarray(v)[known] for v in (mark.x, mark.low, mark.high))
        return {
            "type": "scatter", "mode": "lines", "x": _values(np.concatenate([x, x[::-1]])),
            "y": _values(np.concatenate([low, high[::-1]])), "fill": "toself",
            "fillcolor": colour, "line": {"width": 0}, "hoverinfo": "skip", "name": name,
        }  # fmt: skip
    if isinstance(mark, Bars):
        x, y = _values(mark.x), _values(mark.height)
        texts = {"text": list(mark.texts)} if mark.texts else {}
        return {
            "type": "bar", "x": y if mark.is_horizontal else x, "y": x if mark.is_horizontal else y,
            "width": mark.width, "orientation": "h" if mark.is_horizontal else "v",
            "marker": {"color": colour, "line": {"width": 0}}, "textposition": "outside",
            "cliponaxis": False, "name": name, **texts,
        }  # fmt: skip
    places = {"x": _values(mark.x), "y": _values(mark.y), "name": name}
    if isinstance(mark, Line):
        dash = "dash" if mark.is_dashed else "solid"
        look = {"color": colour, "width": mark.width_px, "dash": dash}
        return {"type": "scatter", "mode": "lines", "line": look, **places}
    if isinstance(mark, Boxes):
        return {
            "type": "box", "boxpoints": "all", "jitter": 0.5, "pointpos": 0,
            "marker": {"color": colour, "size": 4}, "line": {"width": 1},
            "fillcolor": _rgba(mark.colour, 0.15), **places,
        }  # fmt: skip
    if mark.sd is not None:
        places["error_y"] = {"array": _values(1.96 * np.asarray(mark.sd)), "thickness": 1,
                             "color": _rgba(mark.colour, 0.4), "width": 0}  # fmt: skip
    symbol = "circle-open" if mark.is_hollow else "circle"
    look = {"color": colour, "size": mark.size_px, "symbol": symbol}
    return {"type": "scatter", "mode": "markers", "marker": look, **places}


def _axes(panel: Panel, size: Layout) -> tuple[dict[str, Any], dict[str, Any]]:
    """What is on the axes of a panel."""
    each = {"type": "category", "tickmode": "linear", "dtick": 1}
    x: dict[str, Any] = {"title": {"text": escape(panel.xlabel)}}
    y: dict[str, Any] = {
        "title": {"text": escape(panel.ylabel)},
        "showgrid": panel.has_y_ticks,
        "showticklabels": panel.has_y_ticks,
    }
    first = panel.marks[0]
    if isinstance(first, Boxes):
        x |= each | {"tickangle": -SLANT_DEG}
    if isinstance(first, Bars) and first.is_horizontal:
        y |= each | {"autorange": "reversed"}
    if panel.is_log_y:
        y["type"] = "log"
    for axis, limits in ((x, panel.xlim), (y, panel.ylim)):
        if limits is not None:
            axis["range"] = [float(limit) for limit in limits]
    if size.panel_width == CELL_PX:
        x |= {"nticks": 3, "tickangle": 0, "tickfont": {"size": 10}}
    return x, y


def _furnish(layout: dict[str, Any], panel: Panel, end: str) -> None:
    """Title, and what is shaded, named or ruled in a panel."""
    x_axis, y_axis = f"x{end}", f"y{end}"
    shapes, notes = layout["shapes"], layout["annotations"]
    down = {"xref": x_axis, "y0": 0, "y1": 1, "yref": f"{y_axis} domain"}
    rule = {"type": "line", "line": {"color": _rgba("soft"), "width": 1}}
    for start, until, colour, opacity in panel.spans:
        look = {"fillcolor": _rgba(colour, opacity), "line": {"width": 0}, "layer": "below"}
        shapes.append({"type": "rect", "x0": start, "x1": until, **look, **down})
    if panel.level is not None:
        across = {"x0": 0, "x1": 1, "xref": f"{x_axis} domain", "yref": y_axis}
        shapes.append({"y0": panel.level, "y1": panel.level, **across, **rule})
    small = {"font": {"size": 11, "color": _rgba("soft")}, "showarrow": False}
    text = {"xref": x_axis, "yref": f"{y_axis} domain", **small}
    for x, name in panel.names:
        notes.append({"x": x, "y": 1, "yanchor": "top", "text": escape(name), **text})
    if panel.divider is not None:
        x, name = panel.divider
        shapes.append({"x0": x, "x1": x, **down, **rule})
        corner = {"x": x, "y": 0, "xanchor": "left", "yanchor": "bottom"}
        notes.append({"text": escape(name), **text, **corner})
    if panel.title:
        corner = {"xref": f"{x_axis} domain", "x": 0, "y": 1, "yshift": 20, "xanchor": "left"}
        title = {"text": escape(panel.title), "yanchor": "middle", "font": {"size": 13}}
        notes.append({**text, **corner, **title})

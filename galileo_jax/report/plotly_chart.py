"""A chart as an element of a page, drawn by Plotly in the reader's browser.

Colours are written as `@name` or `@name/opacity`: page.js puts in what the page's style sheet has
for them, in its light or its dark version.
"""

import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from galileo_jax.report.chart import SHADED, Band, Chart, Dots, Line, Mark, Panel, is_named

TITLE_PX, PLAIN_PX, LABEL_PX, END_PX = 30, 12, 46, 26
ALONE_PX, STACKED_PX = 210, 150


def chart_element(chart: Chart) -> str:
    """The chart as HTML."""
    figure, height_px = plotly_figure(chart)
    clock = "" if chart.clip is None else f' data-clip="{escape(chart.clip, quote=True)}"'
    return figure_element(figure, chart.label, height_px, clock)


def figure_element(
    figure: Mapping[str, Any], label: str, height_px: int, attributes: str = ""
) -> str:
    """Any Plotly figure (`data`, `layout`; no more than JSON) as HTML.

    Args:
      figure: colours may be the page's: `@accent`, `@ink/0.3`.
      label: what is seen, for those who do not see it.
      height_px: of the element; its width is what the page leaves.
      attributes: of the element.
    """
    encoded = json.dumps(figure, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    return (
        f'<div class="chart" role="img" aria-label="{escape(label, quote=True)}" '
        f'style="height:{height_px}px"{attributes}>'
        f'<script type="application/json">{encoded}</script></div>'
    )


def plotly_figure(chart: Chart) -> tuple[dict[str, Any], int]:
    """`data` and `layout` of a chart, and its height, px."""
    plot_px = STACKED_PX if len(chart.panels) > 1 else ALONE_PX
    above = [TITLE_PX if panel.title else PLAIN_PX for panel in chart.panels]
    below = [LABEL_PX if panel.xlabel else 0 for panel in chart.panels]
    below[-1] = below[-1] or END_PX
    height = sum(above) + sum(below) + plot_px * len(chart.panels)
    inner = height - above[0] - below[-1]
    data: list[dict[str, Any]] = []
    layout: dict[str, Any] = {
        "margin": {"l": 58, "r": 12, "t": above[0], "b": below[-1]},
        "shapes": [],
        "annotations": [],
    }
    top = float(inner)
    for i, panel in enumerate(chart.panels):
        if i > 0:
            top -= above[i]
        domain = [round((top - plot_px) / inner, 5), round(top / inner, 5)]
        top -= plot_px + below[i]
        x, y = ("" if chart.shares_x or i == 0 else str(i + 1)), ("" if i == 0 else str(i + 1))
        is_bottom = i == len(chart.panels) - 1
        layout[f"yaxis{y}"] = {
            "domain": [max(domain[0], 0.0), min(domain[1], 1.0)],
            "anchor": f"x{x}",
            "title": {"text": escape(panel.ylabel)},
            **({"range": _numbers(panel.ylim)} if panel.ylim else {}),
        }
        if is_bottom or not chart.shares_x:
            layout[f"xaxis{x}"] = {
                "anchor": f"y{y}",
                "title": {"text": escape(panel.xlabel)},
                **({"range": _numbers(panel.xlim)} if panel.xlim else {}),
            }
        data += [_trace(mark) | {"xaxis": f"x{x}", "yaxis": f"y{y}"} for mark in panel.marks]
        _furnish(panel, layout, f"x{x}", f"y{y}")
    return {"data": data, "layout": layout}, height


def _trace(mark: Mark) -> dict[str, Any]:
    match mark:
        case Band():
            known = np.isfinite(mark.x) & np.isfinite(mark.low) & np.isfinite(mark.high)
            x, low, high = (np.asarray(v)[known] for v in (mark.x, mark.low, mark.high))
            return {
                "type": "scatter",
                "mode": "lines",
                "x": _numbers(np.concatenate([x, x[::-1]])),
                "y": _numbers(np.concatenate([low, high[::-1]])),
                "fill": "toself",
                "fillcolor": f"@{mark.colour}/{mark.opacity}",
                "line": {"width": 0},
                "hoverinfo": "skip",
                "name": escape(mark.name),
            }
        case Line():
            return {
                "type": "scatter",
                "mode": "lines",
                "x": _numbers(mark.x),
                "y": _numbers(mark.y),
                "line": {
                    "color": f"@{mark.colour}",
                    "width": mark.width_px,
                    "dash": "dash" if mark.is_dashed else "solid",
                },
                "name": escape(mark.name),
            }
        case Dots():
            colour = f"@{mark.colour}"
            errors = None if mark.sd is None else _numbers(1.96 * np.asarray(mark.sd))
            return {
                "type": "scatter",
                "mode": "markers",
                "x": _numbers(mark.x),
                "y": _numbers(mark.y),
                "marker": {
                    "color": colour,
                    "size": mark.size_px,
                    "symbol": "circle-open" if mark.is_hollow else "circle",
                },
                "name": escape(mark.name),
                **(
                    {}
                    if errors is None
                    else {
                        "error_y": {
                            "type": "data", "array": errors, "color": f"{colour}/0.4",
                            "thickness": 1, "width": 0,
                        }
                    }
                ),
            }  # fmt: skip


def _furnish(panel: Panel, layout: dict[str, Any], x: str, y: str) -> None:
    """Title, phases, the stretch that fails and the level."""
    tall = {"xref": x, "yref": f"{y} domain", "y0": 0, "y1": 1, "layer": "below"}
    rectangle = {"type": "rect", "line": {"width": 0}, **tall}
    for phase in panel.phases:
        ends = {"x0": _number(phase.start_s), "x1": _number(phase.end_s)}
        if phase.name in SHADED:
            layout["shapes"].append({**rectangle, **ends, "fillcolor": "@ink/0.06"})
        if panel.xlim and is_named(phase, panel.xlim):
            layout["annotations"].append(
                {
                    "xref": x, "yref": f"{y} domain", "x": (ends["x0"] + ends["x1"]) / 2, "y": 1,
                    "yanchor": "top", "text": escape(phase.name), "showarrow": False,
                    "font": {"size": 11, "color": "@soft"},
                }
            )  # fmt: skip
    if panel.stretch is not None:
        start, end = map(_number, panel.stretch)
        layout["shapes"].append({**rectangle, "x0": start, "x1": end, "fillcolor": "@fails/0.3"})
    if panel.at is not None:
        layout["shapes"].append(
            {
                "type": "line", "xref": f"{x} domain", "yref": y, "x0": 0, "x1": 1,
                "y0": panel.at, "y1": panel.at, "line": {"color": "@soft", "width": 1},
            }
        )  # fmt: skip
    if panel.title:
        layout["annotations"].append(
            {
                "xref": f"{x} domain", "yref": f"{y} domain", "x": 0, "y": 1, "yshift": 20,
                "xanchor": "left", "yanchor": "middle", "text": escape(panel.title),
                "showarrow": False, "font": {"size": 13, "color": "@ink"},
            }
        )  # fmt: skip


def _number(value: float) -> float:
    return float(f"{float(value):.5g}")


def _numbers(values: Sequence[float] | np.ndarray) -> list[float | None]:
    return [_number(v) if np.isfinite(v) else None for v in np.asarray(values, float)]

"""Curves for the page, as Plotly figures of plain data; colours are those of the reports."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

COLOURS = {
    False: {"ink": "#23252b", "soft": "#666973", "line": "#e3dfd7", "accent": "#b34d25",
            "object0": "#c2592f", "object1": "#2d6da9", "object2": "#4a8a3f", "fails": "#d4a017"},
    True: {"ink": "#e8e5df", "soft": "#a3a5ac", "line": "#32343a", "accent": "#ec946b",
           "object0": "#e98c62", "object1": "#6fabe2", "object2": "#86c57b", "fails": "#d9ac3a"},
}  # fmt: skip
Figure = dict[str, Any]
MOST_MISSING = 160
FONT = "system-ui, Segoe UI, Roboto, Arial, sans-serif"


def track_figure(track: Mapping[str, Any], dark: bool, end_s: float) -> Figure:
    """The speed of every object in the picture, px/s, up to the clip's end."""
    colour = COLOURS[dark]
    traces = []
    times = track["times"]
    for i, places in enumerate(track["seen_px"]):
        speeds: list[float | None] = []
        for (a, b), (s, t) in zip(pairwise(places), pairwise(times), strict=True):
            gap = None in a or None in b
            speeds.append(
                None if gap else ((b[0] - a[0]) ** 2 + (b[1] - a[1]) ** 2) ** 0.5 / (t - s)
            )
        traces.append(_points(times[1:], speeds, colour[f"object{i % 3}"], track["objects"][i]))
    figure = _figure(traces, "time, s", "speed, px/s", dark)
    figure["layout"]["xaxis"]["range"] = [0.0, end_s]  # a track that grows does not shift
    return figure


def fit_figure(
    motion: Mapping[str, Any],
    live: Mapping[str, Any] | None,
    dark: bool,
    extra: tuple[str, Mapping[str, Any]] | None = None,
) -> Figure:
    """Measured places with their errors, and the model's curve; dashed what is only looked at."""
    colour = COLOURS[dark]
    traces: list[dict[str, Any]] = []
    for i, name in enumerate(motion["objects"]):
        own = colour[f"object{i % 3}"]
        points = _points(motion["times"], motion["x"][i], own, f"{name}, measured")
        errors = [2 * sd if sd is not None else None for sd in motion["sd_x"][i]]
        points["error_y"] = {"array": errors, "color": own, "thickness": 1, "width": 0}
        traces.append(points)
        model = (live or motion)["model_x"][i]
        traces.append(_curve(motion["times"], model, colour["ink"], f"{name}, model", 2))
        if extra is not None:
            curve = _curve(extra[1]["times"], extra[1]["model_x"][i], colour["accent"], extra[0], 2)
            curve["line"]["dash"] = "dash"
            traces.append(curve)
    return _figure(traces, "time, s", "x, m", dark)


def residual_figure(
    motion: Mapping[str, Any],
    stretches: Sequence[Mapping[str, Any]],
    dark: bool,
    extra: tuple[str, Mapping[str, Any]] | None = None,
) -> Figure:
    """Residuals in units of the noise; x filled, y hollow; where the model fails is shaded."""
    colour = COLOURS[dark]
    traces = []
    for i, name in enumerate(motion["objects"]):
        own = colour[f"object{i % 3}"]
        for axis, symbol in ((0, "circle"), (1, "circle-open")):
            points = _points(
                motion["times"], motion["white"][i][axis], own, f"{name}, {'xy'[axis]}"
            )
            points["marker"] |= {"symbol": symbol, "size": 4}
            traces.append(points)
        if extra is not None:
            curve = _curve(extra[1]["times"], extra[1]["white"][i], own, f"{name}, {extra[0]}", 2)
            curve["line"]["dash"] = "solid" if i == 0 else "dot"
            traces.append(curve)
    figure = _figure(traces, "time, s", "residual / noise", dark)
    band = {"type": "rect", "xref": "paper", "x0": 0, "x1": 1, "y0": -2, "y1": 2}
    shapes = [{**band, "fillcolor": colour["soft"], "opacity": 0.12, "line": {"width": 0}}]
    for one in stretches:
        shapes.append(
            {
                "type": "rect", "yref": "paper", "y0": 0, "y1": 1, "x0": one["start"],
                "x1": one["end"], "fillcolor": colour["fails"], "opacity": 0.25,
                "line": {"width": 0}, "layer": "below",
            }
        )  # fmt: skip
    figure["layout"]["shapes"] = shapes
    return figure


def missing_figure(record: Mapping[str, Any], dark: bool) -> Figure:
    """The acceleration that the model lacks, against time, place and speed."""
    colour = COLOURS[dark]
    traces = []
    against = (("time, s", None), ("along the path, m", "path_m"), ("speed, m/s", "speed_m_s"))
    for i, (name, entry) in enumerate(record["objects"].items()):
        step = slice(None, None, max(1, len(record["time_s"]) // MOST_MISSING))
        for panel, (_, key) in enumerate(against, 1):
            across = (entry[key] if key else record["time_s"])[step]
            own = colour[f"object{i % 3}"]
            points = _points(across, entry["acceleration_m_s2"][step], own, name)
            points |= {"xaxis": f"x{panel}", "yaxis": "y", "showlegend": panel == 1}
            points["marker"]["size"] = 4
            if panel == 1:
                sd = [2 * s if s is not None else None for s in entry["sd_m_s2"][step]]
                points["error_y"] = {"array": sd, "color": own, "thickness": 0.7, "width": 0}
            traces.append(points)
    figure = _figure(traces, "", "missing, m/s²", dark)
    for panel, (title, _) in enumerate(against, 1):
        axis = {**figure["layout"]["xaxis"], "title": {"text": title}}
        axis["domain"] = [(panel - 1) * 0.345, (panel - 1) * 0.345 + 0.31]
        figure["layout"]["xaxis" if panel == 1 else f"xaxis{panel}"] = axis | {"anchor": "y"}
    return figure


def prediction_figure(found: Mapping[str, Any], dark: bool) -> Figure:
    """Where the objects go, with 95 % bands; the clip's end is marked."""
    colour = COLOURS[dark]
    traces = []
    for i, (name, part) in enumerate(found["objects"].items()):
        own = colour[f"object{i % 3}"]
        edge = {"mode": "lines", "line": {"width": 0}, "showlegend": False, "hoverinfo": "skip"}
        traces.append({"x": part["time_s"], "y": part["x_q025_m"], **edge})
        band = {"fill": "tonexty", "fillcolor": f"{own}44"}
        traces.append({"x": part["time_s"], "y": part["x_q975_m"], **edge, **band})
        traces.append(_curve(part["time_s"], part["x_m"], own, name, 2))
    figure = _figure(traces, "time, s", "x, m", dark)
    end = {"type": "line", "yref": "paper", "y0": 0, "y1": 1, "x0": found["clip_end"]}
    end |= {"x1": found["clip_end"], "line": {"color": colour["soft"], "width": 1, "dash": "dot"}}
    figure["layout"]["shapes"] = [end]
    return figure


def _points(x: Any, y: Any, colour: str, name: str) -> dict[str, Any]:
    marker = {"color": colour, "size": 5}
    return {"type": "scatter", "mode": "markers", "x": x, "y": y, "name": name, "marker": marker}


def _curve(x: Any, y: Any, colour: str, name: str, width: float) -> dict[str, Any]:
    line = {"color": colour, "width": width}
    return {"type": "scatter", "mode": "lines", "x": x, "y": y, "name": name, "line": line}


def _figure(traces: list[dict[str, Any]], xtitle: str, ytitle: str, dark: bool) -> Figure:
    colour = COLOURS[dark]
    axis = {
        "gridcolor": colour["line"], "zerolinecolor": colour["line"], "linecolor": colour["soft"],
        "ticks": "outside", "ticklen": 4, "tickcolor": colour["soft"], "automargin": True,
        "fixedrange": False,
    }  # fmt: skip
    layout = {
        "xaxis": {**axis, "title": {"text": xtitle, "standoff": 4}},
        "yaxis": {**axis, "title": {"text": ytitle, "standoff": 6}},
        "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": colour["ink"], "size": 13, "family": FONT}, "uirevision": ytitle,
        "margin": {"l": 56, "r": 12, "t": 8, "b": 36}, "hovermode": "closest",
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom", "x": 0, "font": {"size": 12}},
        "showlegend": True,
    }  # fmt: skip
    config = {"displayModeBar": False, "responsive": True, "scrollZoom": False}
    return {"data": traces, "layout": layout, "config": config}

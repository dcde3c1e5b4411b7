"""Curves for the page: the reports' kinds of chart, as plain data in the studio's frame."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from galileo_jax.report.chart import Band, Chart, Line, Panel, Points, time_limits
from galileo_jax.report.diagnosis_charts import friction_chart, known_objects, missing_force_chart
from galileo_jax.report.fit_charts import noise_band
from galileo_jax.report.plotly_figure import dark, figure, to_json
from galileo_jax.report.style import object_colour

LAYOUT = {
    "paper_bgcolor": "rgba(0,0,0,0)",
    "margin": {"l": 58, "r": 12, "t": 8, "b": 36},
    "legend": {"y": 1.0, "yref": "paper", "yanchor": "bottom"},
    "showlegend": True,
    "height": None,  # that of its place on the page
}
CONFIG = {"displayModeBar": False, "responsive": True, "scrollZoom": False}
EMPTY: dict[str, Any] = {"data": [], "layout": LAYOUT, "config": CONFIG}


def track_figure(track: Mapping[str, Any], is_dark: bool, end_s: float) -> dict[str, Any]:
    """The speed of every object in the picture, px/s, up to the clip's end."""
    times = np.array(track["times"], float)
    marks = []
    for i, (name, seen) in enumerate(zip(track["objects"], track["seen_px"], strict=True)):
        steps = np.diff(np.array(seen, float).reshape(-1, 2), axis=0)
        speed = np.hypot(*steps.T) / np.diff(times)
        marks.append(Points(times[1:], speed, object_colour(i), name))
    # A track that grows does not shift.
    return _figure(Panel("speed, px/s", tuple(marks), xlabel="time, s", xlim=(0.0, end_s)), is_dark)


def fit_figure(motion: Mapping[str, Any], is_dark: bool) -> dict[str, Any]:
    """Measured places with their errors, and the model's curve, where it moves most."""
    times, marks, axis = motion["times"], [], _axis(motion)
    for i, name in enumerate(motion["objects"]):
        measured, sd = (np.array(motion[key][i], float) for key in (axis, f"sd_{axis}"))
        sd[~(sd <= np.nanmax(measured) - np.nanmin(measured))] = np.nan  # not measured
        marks.append(Points(times, measured, object_colour(i), f"{name}, measured", sd=sd))
        curve = motion[f"model_{axis}"][i]
        marks.append(Line(times, curve, "ink", f"{name}, model", width_px=2))
    return _figure(Panel(f"{axis}, m", tuple(marks), xlabel="time, s"), is_dark)


def _axis(motion: Mapping[str, Any]) -> str:
    """Along which most is moved: y of what falls, x of all else."""
    x, y = (np.array(motion[f"model_{axis}"], float) for axis in "xy")
    return "y" if _longest(y) > 2 * _longest(x) else "x"


def _longest(places: np.ndarray) -> float:
    return float(np.max(np.nanmax(places, axis=-1) - np.nanmin(places, axis=-1)))


def residual_figure(
    motion: Mapping[str, Any],
    stretches: Sequence[Mapping[str, Any]],
    is_dark: bool,
    extra: tuple[str, Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """Residuals in units of the noise; x filled, y hollow; where the model fails is shaded.

    `extra`: another model's name, and the residuals that it leaves.
    """
    times, ends = motion["times"], time_limits(motion["times"])
    marks: list[Any] = [noise_band(ends, "")]
    for i, name in enumerate(motion["objects"]):
        for axis, values in zip("xy", motion["white"][i], strict=False):
            label, is_hollow = f"{name}, {axis}", axis == "y"
            marks.append(Points(times, values, object_colour(i), label, is_hollow))
        if extra is not None:
            label, curve = f"{name}, {extra[0]}", extra[1]
            marks.append(Line(curve["times"], curve["white"][i], object_colour(i), label, i > 0, 2))
    failing = tuple((one["start"], one["end"]) for one in stretches)
    panel = Panel("residual / noise", tuple(marks), "", "time, s", ends, highlights=failing)
    return _figure(panel, is_dark)


def missing_figure(record: Mapping[str, Any], is_dark: bool) -> dict[str, Any]:
    """The acceleration that the model lacks, against time, speed and place."""
    first, *others = missing_force_chart(record, known_objects(record)).panels
    beside = (replace(one, ylabel="", has_y_ticks=False) for one in others if one)
    panels = (replace(first, title=""), *beside) if first else ()
    return _figure_of(Chart("", "", panels, columns=len(panels)), is_dark)


def friction_figure(rows: Sequence[Mapping[str, Any]], is_dark: bool) -> dict[str, Any]:
    """The coefficient of friction along the way of the first clip's bodies."""
    return _figure_of(friction_chart(rows, str(rows[0]["clip"])), is_dark)


def prediction_figure(found: Mapping[str, Any], is_dark: bool) -> dict[str, Any]:
    """Where the objects go, with 95 % bands; the clip's end is marked."""
    marks = []
    for i, (name, part) in enumerate(found["objects"].items()):
        times, low, high = (np.array(part[k], float) for k in ("time_s", "x_q025_m", "x_q975_m"))
        marks.append(Band(times, low, high, object_colour(i), ""))
        marks.append(Line(times, part["x_m"], object_colour(i), name, width_px=2))
    end = (found["clip_end"], "")
    return _figure(Panel("x, m", tuple(marks), xlabel="time, s", divider=end), is_dark)


def _figure(panel: Panel, is_dark: bool) -> dict[str, Any]:
    return _figure_of(Chart("", "", (panel,)), is_dark)


def _figure_of(chart: Chart, is_dark: bool) -> dict[str, Any]:
    drawn = json.loads(to_json(figure(chart)))  # without arrays: tabs compare it
    keeps_zoom = {"uirevision": chart.panels[0].ylabel if chart.panels[0] else ""}
    drawn["layout"] |= LAYOUT | keeps_zoom
    drawn["layout"]["template"]["layout"]["yaxis"]["automargin"] = True
    return (dark(drawn) if is_dark else drawn) | {"config": CONFIG}

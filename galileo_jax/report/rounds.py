"""The rounds of a diagnosis: the error, and how it falls."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from galileo_jax.report.findings import effects_text

Figure = dict[str, Any]
HEIGHT_PX = 250


def rounds_figure(history: Sequence[Mapping[str, Any]]) -> Figure:
    """The velocity error of each round beside what tracking noise alone would leave; Plotly."""
    names = [effects_text(row["effects"]) for row in history]
    ends = np.arange(len(history)) + 1
    labels = [f"{number}. {name}" for number, name in zip(ends, names, strict=True)]
    errors = [float(row["rmse"]) for row in history]
    bars = {
        "type": "bar",
        "x": labels,
        "y": errors,
        "width": 0.3,
        "marker": {"color": ["@soft/0.55"] * (len(errors) - 1) + ["@accent"]},
        "text": [f"{error:.4f}" for error in errors],
        "textposition": "outside",
        "cliponaxis": False,
        "name": "velocity error",
        "hovertemplate": "%{y:.5f} m/s<extra>velocity error</extra>",
    }
    noise = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": labels,
        "y": [float(row["noise"]) for row in history],
        "line": {"color": "@ink", "width": 1, "dash": "dot"},
        "marker": {"color": "@ink", "size": 5},
        "name": "tracking noise",
        "hovertemplate": "%{y:.5f} m/s<extra>tracking noise</extra>",
    }
    layout = {
        "margin": {"l": 58, "r": 12, "t": 24, "b": 40},
        "xaxis": {"type": "category", "range": [-0.7, len(history) - 0.3], "showgrid": False},
        "yaxis": {"title": {"text": "m/s"}, "range": [0, 1.18 * max(errors)]},
        "shapes": [],
        "annotations": [],
    }
    return {"data": [bars, noise], "layout": layout}

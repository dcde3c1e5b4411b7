"""One description of a chart, two back-ends: both draw the same marks in the same places."""

import json
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from galileo_jax.comparison.phases import Phase
from galileo_jax.report.chart import Band, Bars, Boxes, Chart, Line, Panel, Points, side_by_side
from galileo_jax.report.draw import to_plotly, to_svg
from galileo_jax.report.html_page import chart_element
from galileo_jax.report.plotly_figure import figure as drawn
from galileo_jax.report.style import palette

X = np.linspace(0.0, 2.0, 5)
PHASES = (Phase("ramp", 0.0, 1.0), Phase("foot", 1.0, 1.1), Phase("table", 1.1, 2.0))


def panel(**more) -> Panel:
    marks = (
        Band(X, X - 1, X + 1, "object1", "95 %"),
        Line(X, X, "object1", "fitted"),
        Points(X, np.where(X == 1.0, np.nan, X), "ink", "measured", sd=0.1 + 0 * X),
    )
    return Panel("v, m/s", marks, **({"xlabel": "time, s", "xlim": (0.0, 2.0)} | more))


def plotly_of(chart: Chart) -> Any:
    return to_plotly(chart)


def chart(*panels: Panel) -> Chart:
    return Chart("a", "a chart", panels or (panel(title="one <b>"),))


def test_plotly_has_every_mark_with_its_values():
    band, line, points = plotly_of(chart()).data
    assert band.fill == "toself" and len(band.x) == 2 * len(X)
    assert line.x == pytest.approx(X) and line.y == pytest.approx(X)
    assert np.isnan(points.y[2]) and points.error_y.array == pytest.approx(0.196 + 0 * X)
    red, green, blue = bytes.fromhex(palette()["object1"][1:])
    assert line.line.color == f"rgba({red},{green},{blue},1)"


def test_phases_failing_times_levels_and_dividers_are_drawn_by_both():
    one = panel(phases=PHASES, highlights=((0.4, 0.6),), level=0.0, divider=(1.5, "the end"))
    figure = plotly_of(chart(one))
    rectangles = [(s.x0, s.x1) for s in figure.layout.shapes if s.type == "rect"]
    assert rectangles == [(1.0, 1.1), (0.4, 0.6)], "the foot, and where the model fails"
    texts = [note.text for note in figure.layout.annotations]
    assert texts == ["ramp", "table", "the end"], "the foot is too short for its name"
    svg = to_svg(chart(one))
    assert all(f">{name}</text>" in svg for name in ("ramp", "table", " the end"))
    assert palette()["fails"] in svg and ">foot</text>" not in svg


def test_names_from_outside_are_escaped():
    assert plotly_of(chart()).layout.annotations[0].text == "one &lt;b&gt;"
    hostile = replace(chart(panel(title="</script>")), label='"><b>', clip='"<i>')
    element = chart_element(hostile)
    assert element.count("</script>") == 1 and "<b>" not in element and "<i>" not in element


def test_a_legend_names_each_kind_of_mark_once():
    figure = plotly_of(chart(panel(xlabel=""), panel()))
    assert [t.name for t in figure.data if t.showlegend] == ["95 %", "fitted", "measured"]
    assert figure.layout.showlegend and not drawn(chart(), False)["layout"]["showlegend"]


def test_panels_share_x_where_only_the_last_has_a_label():
    shared, own = chart(panel(xlabel=""), panel()), chart(panel(), panel())
    assert plotly_of(shared).layout.xaxis.matches == "x2"
    assert plotly_of(own).layout.xaxis.matches is None
    assert plotly_of(own).layout.height > plotly_of(shared).layout.height


def test_charts_side_by_side_are_columns():
    two = side_by_side("two", "two charts", [chart(panel(xlabel=""), panel())] * 2)
    assert two.columns == 2 and len(two.rows) == 2
    figure = plotly_of(two)
    grid = figure.layout.grid
    assert (grid.rows, grid.columns) == (2, 2) and 0 < grid.ygap < grid.xgap < 0.5
    assert figure.layout.xaxis2.matches == "x4"


def test_bars_and_boxes_have_categories():
    bars = Bars(["a", "b"], [1.0, 3.0], "accent", "p", texts=("1", "3"), is_horizontal=True)
    figure = plotly_of(chart(Panel("", (bars,), xlabel="p")))
    assert figure.layout.yaxis.autorange == "reversed", "the first on top"
    assert list(figure.data[0].y) == ["a", "b"] and list(figure.data[0].x) == [1.0, 3.0]
    svg = to_svg(chart(Panel("", (bars,), xlabel="p")))
    assert position_of(svg, "a") < position_of(svg, "b")
    boxes = tuple(
        Boxes(["air", "none"] * 3, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "object1", name, is_beside=True)
        for name in ("grad", "mh")
    )
    assert plotly_of(chart(Panel("error", boxes))).layout.boxmode == "group"
    with pytest.raises(TypeError, match="on pages alone"):
        to_svg(chart(Panel("error", boxes)))


def position_of(svg: str, text: str) -> float:
    """The y of a text of an SVG document."""
    found = re.search(rf"<text[^>]*translate\([\d.]+ ([\d.]+)\)[^>]*>{text}</text>", svg)
    if found is None:
        found = re.search(rf'<text[^>]* y="([\d.]+)"[^>]*>{text}</text>', svg)
    assert found is not None
    return float(found[1])


def test_the_same_chart_gives_the_same_text():
    assert to_svg(chart()) == to_svg(chart())
    assert chart_element(chart()) == chart_element(chart())


def test_the_figure_of_a_page_is_plain_json():
    found = re.search(r"<script[^>]*>(.*)</script>", chart_element(chart()))
    assert found is not None
    figure = json.loads(found[1])
    assert [trace["type"] for trace in figure["data"]] == ["scatter"] * 3

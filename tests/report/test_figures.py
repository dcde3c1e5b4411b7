"""The figures for notebooks: what is in them, of each kind of result."""

from typing import Any

import numpy as np
import pytest

from galileo_jax.comparison.path_residuals import path_residuals
from galileo_jax.diagnosis.document import diagnosis_document
from galileo_jax.prediction.extrapolate import extrapolate
from galileo_jax.prediction.posterior_predictive import posterior_predictive
from galileo_jax.report.diagnosis_charts import comparison_chart, diagnosis_chart
from galileo_jax.report.draw import to_plotly
from galileo_jax.report.fit_charts import fit_chart
from galileo_jax.report.prediction import prediction_chart
from galileo_jax.report.track_chart import track_chart
from tests.found import comparison_of, diagnosis_of, fit_of

pytestmark = pytest.mark.usefixtures("precision")


def traces(figure: Any, name: str) -> list:
    return [trace for trace in figure.data if trace.name == name]


def test_a_track_has_the_measured_positions(hit_run):
    observation = hit_run.problem.observation
    figure: Any = to_plotly(track_chart(observation, "clip"))
    x, y = traces(figure, "object1")
    assert x.y == pytest.approx(observation.position_m[0, 0], abs=1e-6, nan_ok=True)
    assert y.y == pytest.approx(observation.position_m[0, 1], abs=1e-6, nan_ok=True)
    assert x.error_y.array[0] == pytest.approx(1.96 * 2e-4, rel=0.2)


def test_a_fit_has_velocities_and_residuals_of_every_object(hit_run):
    fitted = posterior_predictive(hit_run, seed=0)
    figure: Any = to_plotly(fit_chart(fitted))
    measured = traces(figure, "measured")
    assert len(measured) == len(traces(figure, "fitted")) == 4
    velocities = hit_run.problem.observation.velocity_m_s
    for axis, object_ in np.ndindex(2, 2):
        trace = measured[2 * axis + object_]
        assert trace.y == pytest.approx(velocities[object_, axis], abs=1e-4, nan_ok=True)
    residuals = traces(figure, "x")
    assert residuals[1].y == pytest.approx(fitted.residuals[1, 0], abs=1e-4, nan_ok=True)


def test_a_comparison_shades_where_the_model_fails(trials):
    fails = path_residuals(trials, fit_of(trials, ()), comparison_of(trials, 1e-9), 0)
    fine = path_residuals(trials, fit_of(trials, ()), comparison_of(trials, 0.5), 0)

    def highlighted(paths) -> list[tuple[float, float]]:
        figure: Any = to_plotly(comparison_chart(paths))
        shapes = figure.layout.shapes
        return [(s.x0, s.x1) for s in shapes if s.type == "rect" and ",0.3)" in s.fillcolor]

    assert highlighted(fails) == [pytest.approx(fails[0].failing_s)] * 3, "in all three panels"
    assert highlighted(fine) == []


def test_a_diagnosis_has_the_errors_of_rounds_and_the_probabilities(trials):
    diagnosis = diagnosis_of(trials, "named")
    figure: Any = to_plotly(diagnosis_chart(diagnosis_document(trials, diagnosis, 0)))
    (bars,) = traces(figure, "probability")
    assert list(bars.y) == ["air_drag", "viscous_drag", "release_delay"]
    assert bars.x == pytest.approx([0.9, 0.09, 0.01])
    rounds = [bar for bar in figure.data if bar.type == "bar" and bar is not bars]
    assert [list(bar.x) for bar in rounds] == [["1. no effects"], ["2. air_drag"]]
    assert all(bar.y == pytest.approx([0.02]) for bar in rounds)


def test_a_diagnosis_without_candidates_has_one_bar(trials):
    diagnosis = diagnosis_of(trials, "none")
    bare = type(diagnosis)(diagnosis.rounds, (), diagnosis.verdict)
    figure: Any = to_plotly(diagnosis_chart(diagnosis_document(trials, bare, 0)))
    assert [list(bar.x) for bar in figure.data if bar.type == "bar"] == [["1. no effects"]]


def test_a_prediction_goes_on_after_the_clip(hit_run):
    motions = extrapolate(hit_run, 0.5, 8, 0)
    figure: Any = to_plotly(prediction_chart(hit_run, motions))
    end_s = hit_run.problem.observation.times_s[-1]
    assert max(max(trace.x) for trace in figure.data) == pytest.approx(end_s + 0.5, abs=0.02)
    dashed = [trace for trace in figure.data if trace.line.dash == "dash"]
    assert len(dashed) == 2 and all(min(trace.x) > end_s for trace in dashed)
    assert "end of the clip" in [note.text for note in figure.layout.annotations]

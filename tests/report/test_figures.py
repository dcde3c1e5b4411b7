"""The figures for notebooks: what is in them, of each kind of result."""

from typing import Any

import numpy as np
import pytest

from galileo_jax.comparison.path_residuals import path_residuals
from galileo_jax.prediction.extrapolate import extrapolate
from galileo_jax.prediction.posterior_predictive import posterior_predictive
from galileo_jax.report.figures import (
    comparison_figure,
    diagnosis_figure,
    fit_figure,
    prediction_figure,
    track_figure,
)
from tests.found import comparison_of, diagnosis_of, fit_of, make_trials
from tests.oracle_run import HIT, make_run
from tests.precision import in_64_bit


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    with in_64_bit():
        return make_run(tmp_path_factory.mktemp("run"), HIT, 1.6)


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    with in_64_bit():
        return make_trials(tmp_path_factory.mktemp("clip"))


def traces(figure: Any, name: str) -> list:
    return [trace for trace in figure.data if trace.name == name]


def test_a_track_has_the_measured_positions(run):
    observation = run.problem.observation
    figure: Any = track_figure(observation, "clip")
    x, y = traces(figure, "object1")
    assert x.y == pytest.approx(observation.position_m[0, 0], abs=1e-6, nan_ok=True)
    assert y.y == pytest.approx(observation.position_m[0, 1], abs=1e-6, nan_ok=True)
    assert x.error_y.array[0] == pytest.approx(1.96 * 2e-4, rel=0.2)


def test_a_fit_has_velocities_and_residuals_of_every_object(run):
    fitted = posterior_predictive(run, seed=0)
    figure: Any = fit_figure(fitted)
    measured = traces(figure, "measured")
    assert len(measured) == len(traces(figure, "fitted")) == 4
    velocities = run.problem.observation.velocity_m_s
    for axis, object_ in np.ndindex(2, 2):
        trace = measured[2 * axis + object_]
        assert trace.y == pytest.approx(velocities[object_, axis], abs=1e-4, nan_ok=True)
    residuals = traces(figure, "x")
    assert residuals[1].y == pytest.approx(fitted.residuals[1, 0], abs=1e-4, nan_ok=True)


def test_a_comparison_shades_where_the_model_fails(trials):
    fails = path_residuals(trials, fit_of(trials, ()), comparison_of(trials, 1e-9), 0)
    fine = path_residuals(trials, fit_of(trials, ()), comparison_of(trials, 0.5), 0)

    def highlighted(paths) -> list[tuple[float, float]]:
        figure: Any = comparison_figure(paths)
        shapes = figure.layout.shapes
        return [(s.x0, s.x1) for s in shapes if s.type == "rect" and ",0.3)" in s.fillcolor]

    assert highlighted(fails) == [pytest.approx(fails[0].failing_s)] * 3, "in all three panels"
    assert highlighted(fine) == []


def test_a_diagnosis_has_the_errors_of_rounds_and_the_probabilities(trials):
    diagnosis = diagnosis_of(trials, "named")
    figure: Any = diagnosis_figure(diagnosis)
    (bars,) = traces(figure, "probability")
    assert list(bars.y) == ["air_drag", "viscous_drag", "release_delay"]
    assert bars.x == pytest.approx([0.9, 0.09, 0.01])
    rounds = [bar for bar in figure.data if bar.type == "bar" and bar is not bars]
    assert [list(bar.x) for bar in rounds] == [["1. no effects"], ["2. air_drag"]]
    assert all(bar.y == pytest.approx([0.02]) for bar in rounds)


def test_a_diagnosis_without_candidates_has_one_bar(trials):
    diagnosis = diagnosis_of(trials, "none")
    figure: Any = diagnosis_figure(type(diagnosis)(diagnosis.rounds, (), diagnosis.verdict))
    assert [list(bar.x) for bar in figure.data if bar.type == "bar"] == [["1. no effects"]]


def test_a_prediction_goes_on_after_the_clip(run):
    motions = extrapolate(run, 0.5, 8, 0)
    figure: Any = prediction_figure(run, motions)
    end_s = run.problem.observation.times_s[-1]
    assert max(max(trace.x) for trace in figure.data) == pytest.approx(end_s + 0.5, abs=0.02)
    dashed = [trace for trace in figure.data if trace.line.dash == "dash"]
    assert len(dashed) == 2 and all(min(trace.x) > end_s for trace in dashed)
    assert "end of the clip" in [note.text for note in figure.layout.annotations]

"""The figures of tracks, fits, comparisons, diagnoses and predictions, for notebooks."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from galileo_jax.comparison.path_residuals import PathResiduals
from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.observation.observation import Observation
from galileo_jax.prediction.extrapolate import Motions
from galileo_jax.prediction.posterior_predictive import PosteriorPredictive
from galileo_jax.report.chart import Chart, side_by_side
from galileo_jax.report.comparison_charts import failure_chart
from galileo_jax.report.diagnosis_charts import candidates_chart, rounds_chart
from galileo_jax.report.draw import to_plotly
from galileo_jax.report.fit_charts import object_chart, track_chart
from galileo_jax.report.prediction_chart import prediction_chart
from galileo_jax.results.run import Run

if TYPE_CHECKING:
    import plotly.graph_objects as go

NUM_CANDIDATES = 8


def track_figure(observation: Observation, name: str) -> "go.Figure":
    """Measured x and y of every object against time, m and s, with 95 % intervals."""
    charts = [track_chart(observation, axis) for axis in (0, 1)]
    return to_plotly(side_by_side("track", f"{name}: measured positions", charts))


def fit_figure(fitted: PosteriorPredictive) -> "go.Figure":
    """A column for each object: velocities in x and y, measured and fitted, and residuals.

    Velocities in m/s with 95 % bands, residuals in units of the tracking noise.
    """
    charts = [object_chart(fitted, i) for i in range(len(fitted.observation.names))]
    return to_plotly(side_by_side("fit", "velocities, measured and fitted, and residuals", charts))


def comparison_figure(paths: Sequence[PathResiduals]) -> "go.Figure":
    """A column for each object: position, speed, residuals; where the model fails is shaded."""
    charts = [failure_chart(one) for one in paths]
    return to_plotly(side_by_side("comparison", "position, speed and residuals", charts))


def diagnosis_figure(diagnosis: Diagnosis) -> "go.Figure":
    """The velocity error of each round, and the probabilities of the first candidates."""
    rounds = rounds_chart(diagnosis.rounds)
    if not diagnosis.candidates:
        return to_plotly(rounds)
    candidates = candidates_chart(diagnosis.candidates[:NUM_CANDIDATES])
    panels = (*rounds.panels, *candidates.panels)
    return to_plotly(Chart("diagnosis", "velocity error and candidates", panels, panel_px=200))


def prediction_figure(run: Run, motions: Motions) -> "go.Figure":
    """Positions of every object, m, during the clip and beyond, with 95 % bands."""
    return to_plotly(prediction_chart(run, motions))

"""The chart of a prediction: what was measured, and how the posterior continues it."""

import numpy as np

from galileo_jax.prediction.extrapolate import Motions, as_measured
from galileo_jax.report.chart import Band, Chart, Line, Panel, Points
from galileo_jax.report.style import object_colour
from galileo_jax.results.run import Run

STEP_S = 1 / 60  # between points of the curve


def prediction_chart(run: Run, motions: Motions) -> Chart:
    """Every object's x against time, with 95 % bands, during the clip and beyond.

    Without a surface it is the height: of most such motions x says little.
    """
    observation = run.problem.observation
    clip_end_s = float(observation.times_s[-1])
    stride = max(1, round(STEP_S / (motions.times_s[1] - motions.times_s[0])))
    times = motions.times_s[::stride]
    axis = 0 if run.problem.model.scene.surroundings.has_surface else 1
    shown = as_measured(run.problem.model, motions)[:, :, axis, ::stride]
    marks = []
    for i, name in enumerate(observation.names):
        low, median, high = np.quantile(shown[:, i], [0.025, 0.5, 0.975], axis=0)
        colour, during = object_colour(i), times <= clip_end_s
        marks += [
            Band(times, low, high, colour, "", 0.25),
            Line(times[during], median[during], colour, name),
            Line(times[~during], median[~during], colour, "", is_dashed=True),
            Points(observation.times_s, observation.position_m[i, axis], "ink", "measured",
                   size_px=3.3),
        ]  # fmt: skip
    panel = Panel(
        ylabel=("x, m", "y, m")[axis],
        marks=tuple(marks),
        title="Measured (dots), median and 95 % of the posterior",
        xlabel="time, s",
        divider=(clip_end_s, "end of the clip"),
    )
    label = f"measured and predicted {('x', 'y')[axis]} against time"
    return Chart("prediction", label, (panel,), run.problem.name, panel_px=290)

"""The continued motion: what was measured, and where the posterior says it goes."""

from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.prediction.extrapolate import Motions, as_measured
from galileo_jax.report.figure import COLOURS, INK, style
from galileo_jax.results.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SHOWN_S = 1 / 60  # every so often a point of the curve


def continuation_figure(run: Run, motions: Motions) -> "Figure":
    """Every object's x against time, with 95 % bands, during the clip and beyond.

    Without a surface it is the height: of most such motions x says nothing.
    """
    from matplotlib.figure import Figure

    observation = run.problem.observation
    clip_end_s = observation.times_s[-1]
    stride = max(1, round(SHOWN_S / (motions.times_s[1] - motions.times_s[0])))
    times = motions.times_s[::stride]
    axis = 0 if run.problem.model.scene.surroundings.has_surface else 1
    shown = as_measured(run.problem.model, motions)[:, :, axis, ::stride]
    with style("prediction"):
        figure = Figure(figsize=(7.2, 3.6))
        axes = figure.add_axes((0.11, 0.13, 0.86, 0.78))
        for i, name in enumerate(observation.names):
            low, median, high = np.quantile(shown[:, i], [0.025, 0.5, 0.975], axis=0)
            colour = COLOURS[i % len(COLOURS)]
            axes.fill_between(times, low, high, color=colour, alpha=0.25, linewidth=0)
            during = times <= clip_end_s
            axes.plot(times[during], median[during], color=colour, label=name)
            axes.plot(times[~during], median[~during], color=colour, linestyle=(0, (3, 2)))
            axes.plot(
                observation.times_s, observation.position_m[i, axis], "o", color=INK,
                markersize=2.4, markeredgewidth=0,
            )  # fmt: skip
        axes.axvline(clip_end_s, color=INK, linewidth=0.6, alpha=0.6)
        axes.text(
            clip_end_s, 0.02, " end of the clip", transform=axes.get_xaxis_transform(),
            fontsize=8, alpha=0.65,
        )  # fmt: skip
        axes.set(
            title="Where it goes: measured (dots), median and 95 % of the posterior",
            xlabel="time, s",
            ylabel=("x, m", "y, m")[axis],
        )
        axes.legend(loc="best")
    return figure

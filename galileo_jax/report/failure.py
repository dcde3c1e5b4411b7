"""Where the model fails: place, speed and residual of one object along its path."""

from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.comparison.local_tests import WHOLE
from galileo_jax.report.along import Along
from galileo_jax.report.figure import COLOURS, INK, style
from galileo_jax.report.profiles import shade_phases

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FAILS = "#d4a017"
SIZE_IN, BEFORE_AFTER_IN = (4.8, 6.0), (4.8, 4.0)
LEFT, WIDTH = 0.165, 0.815
SMALLEST_RANGE = 4.0  # of the residuals' axis, in units of the noise


def failure_figure(one: Along) -> "Figure":
    """Measured (dots) and predicted (line, 95 % band) place and speed, and the residuals.

    Residuals: filled along the path, hollow across it. The worst stretch is marked.
    """
    from matplotlib.figure import Figure

    with style(f"failure_{one.clip}_{one.name}"):
        figure = Figure(figsize=SIZE_IN)
        place = figure.add_axes((LEFT, 0.70, WIDTH, 0.255))
        speed = figure.add_axes((LEFT, 0.40, WIDTH, 0.255), sharex=place)
        residual = figure.add_axes((LEFT, 0.08, WIDTH, 0.275), sharex=place)
        place.set(title=_title(one), ylabel="along the path, m")
        _against(place, one, one.times_s, one.measured_m, one.predicted_m, one.low_m, one.high_m)
        step = np.diff(one.times_s)
        middle = one.times_s[:-1] + step / 2
        measured, predicted = (np.diff(v) / step for v in (one.measured_m, one.predicted_m))
        _against(speed, one, middle, measured, predicted, predicted, predicted)
        speed.set(ylabel="speed, m/s")
        _residuals(residual, one, one.largest)
        residual.set(xlabel="time, s", ylabel="residual / noise")
        for axes in (place, speed, residual):
            _mark(axes, one)
        place.legend(loc="best", handlelength=1.4, labelspacing=0.25)
        for axes in (place, speed):
            axes.tick_params(labelbottom=False)
        shade_phases(residual, one.phases, one.times_s)
        figure.align_ylabels()
    return figure


def before_after_figure(before: Along, after: Along, titles: tuple[str, str]) -> "Figure":
    """The residuals of one object before and after an effect was added, on the same axes."""
    from matplotlib.figure import Figure

    with style(f"round_{after.clip}_{after.name}_{titles[1]}"):
        figure = Figure(figsize=BEFORE_AFTER_IN)
        largest = max(before.largest, after.largest)
        for one, title, bottom in zip((before, after), titles, (0.56, 0.12), strict=True):
            axes = figure.add_axes((LEFT, bottom, WIDTH, 0.36))
            _residuals(axes, one, largest)
            axes.set(title=f"{one.title}: {title}", ylabel="residual / noise")
            _mark(axes, one)
            shade_phases(axes, one.phases, one.times_s)
            if bottom < 0.5:
                axes.set_xlabel("time, s")
            else:
                axes.tick_params(labelbottom=False)
    return figure


def _title(one: Along) -> str:
    if one.worst is None:
        return one.title
    where = "" if one.worst.phase == WHOLE else f", {one.worst.phase}"
    return f"{one.title}: worst in {one.worst.axis}{where} (z = {one.worst.z:.0f})"


def _against(
    axes: "Axes",
    one: Along,
    times_s: np.ndarray,
    measured: np.ndarray,
    predicted: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> None:
    colour = COLOURS[one.index]
    axes.fill_between(times_s, low, high, color=colour, alpha=0.3, linewidth=0)
    axes.plot(times_s, predicted, color=colour, label="predicted, 95 % band")
    axes.plot(times_s, measured, "o", color=INK, markersize=2.6, markeredgewidth=0,
              label="measured")  # fmt: skip


def _residuals(axes: "Axes", one: Along, largest: float) -> None:
    colour = COLOURS[one.index]
    axes.axhspan(-2, 2, color=INK, alpha=0.08, linewidth=0)
    axes.axhline(0, color=INK, linewidth=0.6)
    for values, face in ((one.across, "none"), (one.along, colour)):
        axes.plot(
            one.times_s, values, "o", color=colour, markersize=3.0, markerfacecolor=face,
            markeredgewidth=0.6,
        )  # fmt: skip
    bound = 1.1 * max(SMALLEST_RANGE, largest)
    axes.set_ylim(-bound, bound)


def _mark(axes: "Axes", one: Along) -> None:
    if one.stretch_s is not None:
        axes.axvspan(*one.stretch_s, color=FAILS, alpha=0.28, linewidth=0, zorder=0)

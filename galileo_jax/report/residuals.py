"""Residuals in units of the noise: what the model leaves unexplained, and where."""

from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.report.figure import COLOURS, INK, panel, style
from galileo_jax.report.fitted import Fitted
from galileo_jax.report.profiles import shade_phases

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def residual_figure(fitted: Fitted, index: int) -> "Figure":
    """The whitened residuals of one object, both axes; 95 of 100 are expected between the lines."""
    observation = fitted.observation
    name = observation.names[index]
    with style(f"residuals_{name}"):
        figure, axes = panel(f"{name} (filled: x, hollow: y)", "time, s", "residual / noise")
        axes.axhline(0, color=INK, linewidth=0.6)
        for bound in (-2, 2):
            axes.axhline(bound, color=INK, linewidth=0.6, linestyle=(0, (4, 4)), alpha=0.6)
        for axis, marker in enumerate("os"):
            values = fitted.residuals[index, axis]
            axes.plot(
                observation.times_s, values, marker, color=COLOURS[index], markersize=3.2,
                markerfacecolor=COLOURS[index] if axis == 0 else "none", markeredgewidth=0.8,
            )  # fmt: skip
        largest = np.nanmax(np.abs(fitted.residuals[index]), initial=3.0)
        axes.set_ylim(-1.1 * largest, 1.1 * largest)
        shade_phases(axes, fitted.phases[index], observation.times_s)
    return figure

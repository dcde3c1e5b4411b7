"""Residuals in units of the noise: what the model leaves unexplained, and where."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.report.chart import Band, Chart, Dots, Panel, object_colour, time_limits
from galileo_jax.report.fitted import Fitted
from galileo_jax.report.profiles import AXES, with_room
from galileo_jax.report.stretch import strongest

FAILS_Z = 5.0  # of white noise, the strongest of four tracks of 120 frames: over 4.6 in 1 of 100


@dataclass(frozen=True)
class Stretch:
    """Where one object's residuals along one axis are on one side for longest and furthest.

    Attributes:
      name, axis: of the object, and "x" or "y".
      start_s, end_s: of the frames.
      z: |sum| / sqrt(frames), in units of the noise.
    """

    name: str
    axis: str
    start_s: float
    end_s: float
    z: float


def worst_stretch_of(fitted: Fitted) -> Stretch | None:
    """The strongest stretch of all; None where nothing is stronger than noise makes it."""
    found = []
    times = fitted.observation.times_s
    for name, both in zip(fitted.observation.names, fitted.residuals, strict=True):
        for axis, values in zip(AXES, both, strict=True):
            frames = np.flatnonzero(np.isfinite(values))
            if (window := strongest(values[frames])) is not None:
                start, end, z = window
                start_s, end_s = float(times[frames[start]]), float(times[frames[end]])
                found.append(Stretch(name, axis, start_s, end_s, z))
    worst = max(found, key=lambda one: one.z, default=None)
    return worst if worst is not None and worst.z > FAILS_Z else None


def residual_chart(fitted: Fitted, index: int, clip: str) -> Chart:
    """The whitened residuals of one object, both axes; 95 of 100 are expected in the band."""
    observation, colour = fitted.observation, object_colour(index)
    name, times = observation.names[index], observation.times_s
    largest = 1.1 * float(np.nanmax(np.abs(fitted.residuals[index]), initial=3.0))
    xlim = time_limits(times)
    ends = np.array(xlim)
    worst = worst_stretch_of(fitted)
    is_here = worst is not None and worst.name == name
    panel = Panel(
        ylabel="residual / noise",
        marks=(
            Band(ends, np.full(2, -2.0), np.full(2, 2.0), "ink", "95 % of noise", 0.07),
            Dots(times, fitted.residuals[index, 1], colour, "y", is_hollow=True),
            Dots(times, fitted.residuals[index, 0], colour, "x"),
        ),
        title=f"{name} (filled: x, hollow: y)",
        xlabel="time, s",
        xlim=xlim,
        ylim=with_room(-largest, largest),
        phases=fitted.phases[index],
        stretch=(worst.start_s, worst.end_s) if worst is not None and is_here else None,
        at=0.0,
    )
    label = f"what the fit leaves of {name} against time, in units of the noise"
    return Chart(f"residuals_{name}", label, (panel,), clip)

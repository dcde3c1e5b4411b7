"""Velocity profiles and positions, measured against fitted, with 95 % bands."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.report.figure import COLOURS, INK, panel, style
from galileo_jax.report.fitted import Fitted, Phase

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

AXES = ("x", "y")
SHADED = ("held", "foot", "collision", "after the hit")
LETTER = 0.021  # of the panel's width, what a phase's name takes


def velocity_figure(fitted: Fitted, index: int, axis: int) -> "Figure":
    """The velocity profile of one object along one axis.

    Dark band: the model's velocity with the posterior's uncertainty. Light band: where 95 % of
    measured velocities are expected, tracking noise included.
    """
    observation = fitted.observation
    times = observation.times_s
    step = np.diff(times)
    middle = times[:-1] + step / 2
    drawn = np.diff(fitted.position_m[:, index, axis], axis=-1) / step
    variance = observation.covariance_m2[index, axis, axis] * fitted.noise_scale**2
    noise = np.sqrt(variance[1:] + variance[:-1]) / step
    name = observation.names[index]
    with style(f"velocity_{name}_{AXES[axis]}"):
        figure, axes = panel(f"{name}, {AXES[axis]}", "time, s", "velocity, m/s")
        _fill(axes, middle, drawn, noise, index)
        measured = observation.velocity_m_s[index, axis]
        _measured(axes, middle, measured, noise)
        shade_phases(axes, fitted.phases[index], times)
        _legend(axes, index, axis)
    return figure


def position_figure(fitted: Fitted, index: int, axis: int) -> "Figure":
    """The position of one object along one axis."""
    observation = fitted.observation
    variance = observation.covariance_m2[index, axis, axis] * fitted.noise_scale**2
    name = observation.names[index]
    with style(f"position_{name}_{AXES[axis]}"):
        figure, axes = panel(f"{name}, {AXES[axis]}", "time, s", f"{AXES[axis]}, m")
        drawn = fitted.position_m[:, index, axis]
        noise, measured = np.sqrt(variance), observation.position_m[index, axis]
        _fill(axes, observation.times_s, drawn, noise, index)
        _measured(axes, observation.times_s, measured, noise)
        shade_phases(axes, fitted.phases[index], observation.times_s)
        _legend(axes, index, axis)
    return figure


def shade_phases(axes: "Axes", phases: Sequence[Phase], times_s: np.ndarray) -> None:
    """Shades the passages between phases, and what follows the hit; names those wide enough."""
    whole = float(times_s[-1] - times_s[0])
    axes.set_xlim(times_s[0] - 0.02 * whole, times_s[-1] + 0.02 * whole)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.14 * (high - low))  # room for the names
    for phase in phases:
        if phase.name in SHADED:
            axes.axvspan(phase.start_s, phase.end_s, color=INK, alpha=0.06, linewidth=0)
        if phase.end_s - phase.start_s > LETTER * len(phase.name) * whole:
            axes.text(
                (phase.start_s + phase.end_s) / 2,
                0.985,
                phase.name,
                transform=axes.get_xaxis_transform(),
                ha="center",
                va="top",
                fontsize=8,
                alpha=0.65,
            )


def _fill(
    axes: "Axes", times_s: np.ndarray, drawn: np.ndarray, noise: np.ndarray, index: int
) -> None:
    """Median and bands of `drawn` `[draw, time]`; `noise` `[time]` is a standard deviation."""
    colour = COLOURS[index]
    low, median, high = np.quantile(drawn, [0.025, 0.5, 0.975], axis=0)
    spread = 1.96 * np.sqrt(drawn.var(axis=0) + np.where(np.isfinite(noise), noise, 0.0) ** 2)
    mean = drawn.mean(axis=0)
    axes.fill_between(
        times_s, mean - spread, mean + spread, color=colour, alpha=0.18, linewidth=0,
        label="95 % of measurements",
    )  # fmt: skip
    axes.fill_between(
        times_s, low, high, color=colour, alpha=0.45, linewidth=0, label="95 % of the model"
    )
    axes.plot(times_s, median, color=colour, label="fitted")


def _measured(axes: "Axes", times_s: np.ndarray, values: np.ndarray, noise: np.ndarray) -> None:
    """The dots; the panel shows all of them, but not all of a band that is far wider."""
    axes.plot(times_s, values, "o", color=INK, markersize=2.6, markeredgewidth=0, label="measured")
    seen = np.isfinite(values)
    if seen.any():
        span = np.ptp(values[seen])
        spare = max(0.1 * span, min(3 * float(np.median(noise[seen])), max(0.5 * span, 1e-3)))
        axes.set_ylim(values[seen].min() - spare, values[seen].max() + spare)


def _legend(axes: "Axes", index: int, axis: int) -> None:
    """A legend in the first panel of a group only."""
    if index == 0 and axis == 0:
        axes.legend(loc="best", bbox_to_anchor=(0, 0, 1, 0.9), handlelength=1.4, labelspacing=0.25)

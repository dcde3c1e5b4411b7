"""Velocity profiles and positions, measured against fitted, with 95 % bands."""

import numpy as np

from galileo_jax.report.chart import Band, Chart, Dots, Line, Panel, object_colour, time_limits
from galileo_jax.report.fitted import Fitted

AXES = ("x", "y")
NAMES_ROOM = 0.14  # of a panel's height, for the phases' names


def velocity_chart(fitted: Fitted, index: int, axis: int, clip: str) -> Chart:
    """The velocity profile of one object along one axis.

    Dark band: the model's velocity with the posterior's uncertainty. Light band: where 95 % of
    measured velocities are expected, tracking noise included.
    """
    observation = fitted.observation
    times = observation.times_s
    step = np.diff(times)
    drawn = np.diff(fitted.position_m[:, index, axis], axis=-1) / step
    variance = observation.covariance_m2[index, axis, axis] * fitted.noise_scale**2
    noise = np.sqrt(variance[1:] + variance[:-1]) / step
    measured = observation.velocity_m_s[index, axis]
    middle = times[:-1] + step / 2
    return _chart(fitted, index, axis, clip, "velocity", "m/s", middle, drawn, noise, measured)


def position_chart(fitted: Fitted, index: int, axis: int, clip: str) -> Chart:
    """The position of one object along one axis."""
    observation = fitted.observation
    drawn = fitted.position_m[:, index, axis]
    noise = fitted.noise_scale * np.sqrt(observation.covariance_m2[index, axis, axis])
    measured = observation.position_m[index, axis]
    times = observation.times_s
    return _chart(fitted, index, axis, clip, "position", "m", times, drawn, noise, measured)


def _chart(
    fitted: Fitted,
    index: int,
    axis: int,
    clip: str,
    quantity: str,
    unit: str,
    times_s: np.ndarray,
    drawn: np.ndarray,
    noise: np.ndarray,
    measured: np.ndarray,
) -> Chart:
    """Bands of `drawn` `[draw, time]` with the measured values on top; `noise` is their sd."""
    name, colour = fitted.observation.names[index], object_colour(index)
    low, median, high = np.quantile(drawn, [0.025, 0.5, 0.975], axis=0)
    spread = 1.96 * np.sqrt(drawn.var(axis=0) + np.where(np.isfinite(noise), noise, 0.0) ** 2)
    mean = drawn.mean(axis=0)
    marks = (
        Band(times_s, mean - spread, mean + spread, colour, "95 % of measurements", 0.16),
        Band(times_s, low, high, colour, "95 % of the model", 0.4),
        Line(times_s, median, colour, "fitted"),
        Dots(times_s, measured, "ink", "measured"),
    )
    panel = Panel(
        ylabel=f"{quantity}, {unit}",
        marks=marks,
        title=f"{name}, {AXES[axis]}",
        xlabel="time, s",
        xlim=time_limits(fitted.observation.times_s),
        ylim=with_room(*_limits(measured, noise)) if np.isfinite(measured).any() else None,
        phases=fitted.phases[index],
    )
    label = f"{quantity} of {name} along {AXES[axis]} against time, measured and fitted"
    return Chart(f"{quantity}_{name}_{AXES[axis]}", label, (panel,), clip)


def with_room(low: float, high: float) -> tuple[float, float]:
    """The ends of an axis with room for the phases' names."""
    return low, high + NAMES_ROOM * (high - low)


def _limits(values: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """Of an axis that shows all measured values, but not all of a band that is far wider."""
    seen = np.isfinite(values)
    span = np.ptp(values[seen])
    spare = max(0.1 * span, min(3 * float(np.median(noise[seen])), max(0.5 * span, 1e-3)))
    return float(values[seen].min() - spare), float(values[seen].max() + spare)

"""Charts of a fit: velocities and positions, measured and fitted, and the residuals."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.observation.observation import Observation
from galileo_jax.report.chart import (
    Band,
    Chart,
    Line,
    Panel,
    Phase,
    Points,
    stacked,
    time_limits,
    with_room,
)
from galileo_jax.report.posterior_predictive import PosteriorPredictive
from galileo_jax.report.style import object_colour
from galileo_jax.report.worst_interval import worst_interval

AXES = ("x", "y")
FAILS_Z = 5.0  # of white noise, the largest of four tracks of 120 frames is over 4.6 in 1 of 100
SMALLEST_RANGE = 3.3  # of the residuals' axis, in units of the noise


@dataclass(frozen=True)
class FailingInterval:
    """Where the residuals of one object along one axis deviate most to one side.

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


def failing_interval_of(fitted: PosteriorPredictive) -> FailingInterval | None:
    """The worst interval of all objects; None where none is worse than noise makes it."""
    found = []
    times = fitted.observation.times_s
    for name, both in zip(fitted.observation.names, fitted.residuals, strict=True):
        for axis, values in zip(AXES, both, strict=True):
            frames = np.flatnonzero(np.isfinite(values))
            if (interval := worst_interval(values[frames])) is not None:
                start, end, z = interval
                start_s, end_s = float(times[frames[start]]), float(times[frames[end]])
                found.append(FailingInterval(name, axis, start_s, end_s, z))
    worst = max(found, key=lambda one: one.z, default=None)
    return worst if worst is not None and worst.z > FAILS_Z else None


def velocity_chart(fitted: PosteriorPredictive, index: int, axis: int, clip: str) -> Chart:
    """The velocity profile of one object along one axis.

    Dark band: the model's velocity with the posterior's uncertainty. Light band: where 95 % of
    measured velocities are expected, tracking noise included.
    """
    panel = velocity_panel(fitted, index, axis)
    return _chart(fitted, index, axis, clip, "velocity", panel)


def position_chart(fitted: PosteriorPredictive, index: int, axis: int, clip: str) -> Chart:
    """The position of one object along one axis."""
    observation = fitted.observation
    panel = _profile_panel(
        fitted,
        (index, axis),
        "position, m",
        observation.times_s,
        fitted.position_m[:, index, axis],
        fitted.noise_scale * np.sqrt(observation.covariance_m2[index, axis, axis]),
        observation.position_m[index, axis],
    )
    return _chart(fitted, index, axis, clip, "position", panel)


def residual_chart(fitted: PosteriorPredictive, index: int, clip: str) -> Chart:
    """The residuals of one object in units of the noise, both axes."""
    name = fitted.observation.names[index]
    label = f"residuals of {name} against time, in units of the noise"
    return Chart(f"residuals_{name}", label, (fit_residual_panel(fitted, index),), clip)


def object_chart(fitted: PosteriorPredictive, index: int) -> Chart:
    """Both velocities of one object, and its residuals below."""
    name = fitted.observation.names[index]
    velocities = (velocity_panel(fitted, index, axis) for axis in range(len(AXES)))
    label = f"velocity of {name} against time, measured and fitted, and residuals"
    return stacked(f"fit_{name}", label, (*velocities, fit_residual_panel(fitted, index)))


def track_chart(observation: Observation, axis: int) -> Chart:
    """The measured positions of all objects along one axis, each with its 95 % interval."""
    marks = tuple(
        Points(
            observation.times_s,
            observation.position_m[i, axis],
            object_colour(i),
            name,
            sd=np.sqrt(observation.covariance_m2[i, axis, axis]),
        )
        for i, name in enumerate(observation.names)
    )
    panel = Panel(
        f"{AXES[axis]}, m", marks, xlabel="time, s", xlim=time_limits(observation.times_s)
    )
    return Chart(f"track_{AXES[axis]}", f"measured {AXES[axis]} against time", (panel,))


def velocity_panel(fitted: PosteriorPredictive, index: int, axis: int) -> Panel:
    """As `velocity_chart`."""
    observation = fitted.observation
    step = np.diff(observation.times_s)
    variance = observation.covariance_m2[index, axis, axis] * fitted.noise_scale**2
    return _profile_panel(
        fitted,
        (index, axis),
        "velocity, m/s",
        observation.times_s[:-1] + step / 2,
        np.diff(fitted.position_m[:, index, axis], axis=-1) / step,
        np.sqrt(variance[1:] + variance[:-1]) / step,
        observation.velocity_m_s[index, axis],
    )


def fit_residual_panel(fitted: PosteriorPredictive, index: int) -> Panel:
    """The whitened residuals of one object in x and y."""
    name = fitted.observation.names[index]
    worst = failing_interval_of(fitted)
    is_here = worst is not None and worst.name == name
    x, y = fitted.residuals[index]
    return residual_panel(
        fitted.observation.times_s,
        {"x": x, "y": y},
        index,
        title=f"{name} (filled: x, hollow: y)",
        phases=fitted.phases[index],
        highlight=(worst.start_s, worst.end_s) if worst is not None and is_here else None,
    )


def residual_panel(
    times_s: np.ndarray,
    residuals: dict[str, np.ndarray],
    index: int,
    *,
    title: str,
    phases: tuple[Phase, ...],
    highlight: tuple[float, float] | None,
    largest: float = 0.0,
) -> Panel:
    """Residuals in units of the noise against time, with the band of 95 % of noise.

    Args:
      times_s: `[frame]`.
      residuals: two series `[frame]` by name: drawn filled and hollow.
      index: of the object.
      title: of the panel.
      phases: of the motion.
      highlight: the interval that fails.
      largest: of residuals that the axis has to hold, beside these.
    """
    (filled_name, filled), (hollow_name, hollow) = residuals.items()
    largest = max(largest, float(np.nanmax(np.abs([filled, hollow]), initial=0.0)))
    bound = max(SMALLEST_RANGE, 1.1 * largest)
    colour, xlim = object_colour(index), time_limits(times_s)
    two = np.full(2, 2.0)
    return Panel(
        ylabel="residual / noise",
        marks=(
            Band(np.array(xlim), -two, two, "ink", "95 % of noise", 0.07),
            Points(times_s, hollow, colour, hollow_name, is_hollow=True),
            Points(times_s, filled, colour, filled_name),
        ),
        title=title,
        xlabel="time, s",
        xlim=xlim,
        ylim=with_room(-bound, bound),
        phases=phases,
        highlight=highlight,
        level=0.0,
    )


def _chart(
    fitted: PosteriorPredictive, index: int, axis: int, clip: str, quantity: str, panel: Panel
) -> Chart:
    name = fitted.observation.names[index]
    label = f"{quantity} of {name} along {AXES[axis]} against time, measured and fitted"
    return Chart(f"{quantity}_{name}_{AXES[axis]}", label, (panel,), clip)


def _profile_panel(
    fitted: PosteriorPredictive,
    which: tuple[int, int],
    ylabel: str,
    times_s: np.ndarray,
    drawn: np.ndarray,
    noise: np.ndarray,
    measured: np.ndarray,
) -> Panel:
    """Bands of `drawn` `[draw, time]` with the measured values on top; `noise` is their sd."""
    index, axis = which
    colour = object_colour(index)
    low, median, high = np.quantile(drawn, [0.025, 0.5, 0.975], axis=0)
    spread = 1.96 * np.sqrt(drawn.var(axis=0) + np.where(np.isfinite(noise), noise, 0.0) ** 2)
    mean = drawn.mean(axis=0)
    return Panel(
        ylabel=ylabel,
        marks=(
            Band(times_s, mean - spread, mean + spread, colour, "95 % of measurements", 0.16),
            Band(times_s, low, high, colour, "95 % of the model", 0.4),
            Line(times_s, median, colour, "fitted"),
            Points(times_s, measured, "ink", "measured"),
        ),
        title=f"{fitted.observation.names[index]}, {AXES[axis]}",
        xlabel="time, s",
        xlim=time_limits(fitted.observation.times_s),
        ylim=with_room(*_limits(measured, noise)) if np.isfinite(measured).any() else None,
        phases=fitted.phases[index],
    )


def _limits(values: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """Of an axis that shows all measured values, but not all of a band that is far wider."""
    known = np.isfinite(values)
    span = np.ptp(values[known])
    spare = max(0.1 * span, min(3 * float(np.median(noise[known])), max(0.5 * span, 1e-3)))
    return float(values[known].min() - spare), float(values[known].max() + spare)

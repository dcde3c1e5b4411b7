"""Charts of a fit: velocities and positions, residuals, and the posterior's draws."""

import re
from itertools import pairwise
from typing import Literal

import numpy as np

from galileo_jax.comparison.path_residuals import Interval, worst_interval
from galileo_jax.comparison.phases import Phase
from galileo_jax.inference.posterior import Posterior
from galileo_jax.prediction.posterior_predictive import PosteriorPredictive
from galileo_jax.report.chart import (
    Band,
    Bars,
    Chart,
    Line,
    Panel,
    Points,
    side_by_side,
    stacked,
    time_limits,
    with_room,
)
from galileo_jax.report.style import OBJECTS, object_colour

Quantity = Literal["velocity", "position"]
PER = {"velocity": "/s", "position": ""}
FAILS_Z = 5.0  # of white noise, the largest of four tracks of 120 frames is over 4.6 in 1 of 100
SMALLEST_RANGE = 3.3  # of the residuals' axis, in units of the noise
NUM_PAIRS, NUM_TRACE = 800, 400  # draws in a panel, of a chain
NUM_BINS = 30
PAIR_PX, TRACE_PX = 88, 90  # heights of panels
CHAIN_COLOURS = (*OBJECTS, "ink")


def failing_interval_of(fitted: PosteriorPredictive) -> tuple[str, str, Interval] | None:
    """Object, axis and the worst interval of all; None where none is worse than noise makes it."""
    found = [
        (name, axis, interval)
        for name, both in zip(fitted.observation.names, fitted.residuals, strict=True)
        for axis, values in zip(fitted.observation.axes, both, strict=True)
        if (interval := worst_interval(values, fitted.observation.times_s)) is not None
    ]
    worst = max(found, key=lambda one: one[2].z, default=None)
    return worst if worst is not None and worst[2].z > FAILS_Z else None


def profile_chart(
    fitted: PosteriorPredictive, quantity: Quantity, index: int, axis: int, clip: str
) -> Chart:
    """The velocity profile or the position of one object along one axis."""
    name, along = fitted.observation.names[index], fitted.observation.axes[axis]
    label = f"{quantity} of {name} along {along} against time, measured and fitted"
    panel = profile_panel(fitted, quantity, index, axis)
    return Chart(f"{quantity}_{name}_{along}", label, (panel,), clip)


def residual_chart(fitted: PosteriorPredictive, index: int, clip: str) -> Chart:
    """The residuals of one object in units of the noise, both axes."""
    name = fitted.observation.names[index]
    label = f"residuals of {name} against time, in units of the noise"
    return Chart(f"residuals_{name}", label, (fit_residual_panel(fitted, index),), clip)


def fit_chart(fitted: PosteriorPredictive) -> Chart:
    """A column for each object: velocities in x and y, measured and fitted, and residuals.

    Velocities in m/s with 95 % bands, residuals in units of the tracking noise.
    """
    columns, axes = [], range(len(fitted.observation.axes))
    for i in range(len(fitted.observation.names)):
        velocities = (profile_panel(fitted, "velocity", i, axis) for axis in axes)
        columns.append(stacked("", "", (*velocities, fit_residual_panel(fitted, i))))
    return side_by_side("fit", "velocities, measured and fitted, and residuals", columns)


def fit_residual_panel(fitted: PosteriorPredictive, index: int) -> Panel:
    """The whitened residuals of one object in x and y; the charts of z show its own."""
    name = fitted.observation.names[index]
    found = failing_interval_of(fitted)
    x, y, *_ = fitted.residuals[index]
    return residual_panel(
        fitted.observation.times_s,
        {"x": x, "y": y},
        index,
        title=f"{name} (filled: x, hollow: y)",
        phases=fitted.phases[index],
        highlight=(found[2].start_s, found[2].end_s) if found and found[0] == name else None,
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

    `residuals`: two series `[frame]` by name, drawn filled and hollow. `highlight`: the interval
    that fails. `largest`: of other residuals that the axis has to hold.
    """
    (filled_name, filled), (hollow_name, hollow) = residuals.items()
    largest = max(largest, float(np.nanmax(np.abs([filled, hollow]), initial=0.0)))
    bound = max(SMALLEST_RANGE, 1.1 * largest)
    colour, xlim = object_colour(index), time_limits(times_s)
    return Panel(
        ylabel="residual / noise",
        marks=(
            noise_band(xlim, "95 % of noise"),
            Points(times_s, hollow, colour, hollow_name, is_hollow=True),
            Points(times_s, filled, colour, filled_name),
        ),
        title=title,
        xlabel="time, s",
        xlim=xlim,
        ylim=with_room(-bound, bound),
        phases=phases,
        highlights=(highlight,),
        level=0.0,
    )


def noise_band(xlim: tuple[float, float], name: str) -> Band:
    """Where 95 % of residuals in units of the noise are, if they are noise."""
    two = np.full(2, 2.0)
    return Band(np.array(xlim), -two, two, "ink", name, 0.07)


def profile_panel(fitted: PosteriorPredictive, quantity: Quantity, index: int, axis: int) -> Panel:
    """The velocity or the position of one object along one axis, measured and fitted.

    Dark band: the model with the uncertainty of the posterior. Light band: where 95 % of
    measurements are expected, tracking noise included.
    """
    observation = fitted.observation
    name, along = observation.names[index], observation.axes[axis]
    times_s, drawn = observation.times_s, fitted.position_m[:, index, axis]
    measured = observation.position_m[index, axis]
    variance = observation.covariance_m2[index, axis, axis]
    if quantity == "velocity":
        step = np.diff(times_s)
        times_s, drawn = times_s[:-1] + step / 2, np.diff(drawn, axis=-1) / step
        measured = observation.velocity_m_s[index, axis]
        variance = (variance[1:] + variance[:-1]) / step**2
    noise = np.sqrt(variance)
    colour = object_colour(index)
    low, median, high = np.quantile(drawn, [0.025, 0.5, 0.975], axis=0)
    spread = 1.96 * np.sqrt(drawn.var(axis=0) + np.where(np.isfinite(noise), noise, 0.0) ** 2)
    mean = drawn.mean(axis=0)
    return Panel(
        ylabel=f"{quantity}, {'rad' if along == 'turning' else 'm'}{PER[quantity]}",
        marks=(
            Band(times_s, mean - spread, mean + spread, colour, "95 % of measurements", 0.16),
            Band(times_s, low, high, colour, "95 % of the model", 0.4),
            Line(times_s, median, colour, "fitted"),
            Points(times_s, measured, "ink", "measured"),
        ),
        title=f"{name}, {along}",
        xlabel="time, s",
        xlim=time_limits(observation.times_s),
        ylim=with_room(*_limits(measured, noise)) if np.isfinite(measured).any() else None,
        phases=fitted.phases[index],
    )


def _limits(values: np.ndarray, noise: np.ndarray) -> tuple[float, float]:
    """Of an axis that shows all measured values, but not all of a band that is far wider."""
    known = np.isfinite(values)
    span = np.ptp(values[known])
    spare = max(0.1 * span, min(3 * float(np.median(noise[known])), max(0.5 * span, 1e-3)))
    return float(values[known].min() - spare), float(values[known].max() + spare)


def _main_draws(posterior: Posterior, names: list[str]) -> dict[str, np.ndarray]:
    """`[chain, draw]` by name: the given parameters and the ratios of neighbours' masses."""
    shown = {name: posterior[name] for name in names}
    masses = [name for name in names if re.fullmatch(r"m\d+", name)]
    ratios = {f"{a} / {b}": posterior[a] / posterior[b] for a, b in pairwise(masses)}
    return shown | ratios


def pair_chart(posterior: Posterior, names: list[str]) -> Chart:
    """Every pair of the main parameters; on the diagonal each one's histogram."""
    columns = {key: value.reshape(-1) for key, value in _main_draws(posterior, names).items()}
    panels = []
    for row, y_name in enumerate(columns):
        for column, x_name in enumerate(columns):
            if column > row:
                panels.append(None)
                continue
            x, y = columns[x_name], columns[y_name]
            stride = max(1, x.size // NUM_PAIRS)
            mark = _histogram(x_name, x)
            if row != column:
                mark = Points(x[::stride], y[::stride], "object2", f"{x_name}, {y_name}",
                              size_px=3, opacity=0.35)  # fmt: skip
            panels.append(
                Panel(
                    ylabel=y_name if column == 0 and row > 0 else "",
                    marks=(mark,),
                    xlabel=x_name if row == len(columns) - 1 else "",
                    has_y_ticks=column == 0 and row > 0,
                )
            )
    label = "draws of the posterior, pairs of parameters"
    return Chart("pairs", label, tuple(panels), columns=len(columns), panel_px=PAIR_PX)


def _histogram(name: str, values: np.ndarray) -> Bars:
    bins = NUM_BINS if np.ptp(values) > 1e-6 * np.abs(values).max() else 1  # a stuck chain
    counts, edges = np.histogram(values, bins)
    width = float(edges[1] - edges[0])
    return Bars(edges[:-1] + width / 2, counts, "object2", name, width, opacity=0.75)


def trace_chart(posterior: Posterior, names: list[str]) -> Chart:
    """The main parameters of every chain, draw by draw."""
    panels = []
    for name, chains in _main_draws(posterior, names).items():
        index = np.arange(chains.shape[1])[:: max(1, chains.shape[1] // NUM_TRACE)]
        lines = tuple(
            Line(index, chain[index], CHAIN_COLOURS[i % len(CHAIN_COLOURS)], f"chain {i + 1}",
                 width_px=0.7, opacity=0.6)
            for i, chain in enumerate(chains)
        )  # fmt: skip
        panels.append(Panel(name, lines, xlabel="draw"))
    label = "draws of the posterior against their number, chain by chain"
    return stacked("trace", label, panels, panel_px=TRACE_PX)

"""Where the model fails: place, speed and residual of one object along its path."""

import numpy as np

from galileo_jax.comparison.local_tests import WHOLE
from galileo_jax.report.along import Along
from galileo_jax.report.chart import Band, Chart, Dots, Line, Panel, object_colour, time_limits
from galileo_jax.report.profiles import with_room

SMALLEST_RANGE = 4.0  # of the residuals' axis, in units of the noise


def failure_chart(one: Along) -> Chart:
    """Measured (dots) and predicted (line, 95 % band) place and speed, and the residuals.

    Residuals: filled along the path, hollow across it. The worst stretch is marked.
    """
    colour = object_colour(one.index)
    step = np.diff(one.times_s)
    middle = one.times_s[:-1] + step / 2
    place = Panel(
        ylabel="along the path, m",
        title=_title(one),
        marks=(
            Band(one.times_s, one.low_m, one.high_m, colour, "95 % of the model"),
            Line(one.times_s, one.predicted_m, colour, "fitted"),
            Dots(one.times_s, one.measured_m, "ink", "measured"),
        ),
        stretch=one.stretch_s,
    )
    speed = Panel(
        ylabel="speed, m/s",
        marks=(
            Line(middle, np.diff(one.predicted_m) / step, colour, "fitted"),
            Dots(middle, np.diff(one.measured_m) / step, "ink", "measured"),
        ),
        stretch=one.stretch_s,
    )
    name = f"{one.clip}_{one.name}"
    label = f"{one.title}: place, speed and what the fit leaves over, against time"
    return Chart(f"failure_{name}", label, (place, speed, _residuals(one, one.largest)), one.clip)


def before_after_chart(before: Along, after: Along, titles: tuple[str, str]) -> Chart:
    """The residuals of one object before and after an effect was added, on the same axes."""
    largest = max(before.largest, after.largest)
    panels = tuple(
        _residuals(one, largest, f"{one.title}: {title}")
        for one, title in zip((before, after), titles, strict=True)
    )
    label = f"{after.title}: what is left before and after {titles[1]} was added"
    added = titles[1].replace(", ", "+").replace(" ", "_")
    return Chart(f"before_after_{after.clip}_{after.name}_{added}", label, panels, after.clip)


def _title(one: Along) -> str:
    if one.worst is None:
        return one.title
    where = "" if one.worst.phase == WHOLE else f", {one.worst.phase}"
    return f"{one.title}: worst in {one.worst.axis}{where} (z = {one.worst.z:.0f})"


def _residuals(one: Along, largest: float, title: str = "") -> Panel:
    colour, bound = object_colour(one.index), 1.1 * max(SMALLEST_RANGE, largest)
    xlim = time_limits(one.times_s)
    band = Band(np.array(xlim), np.full(2, -2.0), np.full(2, 2.0), "ink", "95 % of noise", 0.07)
    return Panel(
        ylabel="residual / noise",
        marks=(
            band,
            Dots(one.times_s, one.across, colour, "across the path", is_hollow=True),
            Dots(one.times_s, one.along, colour, "along the path"),
        ),
        title=title,
        xlabel="time, s",
        xlim=xlim,
        ylim=with_room(-bound, bound),
        phases=one.phases,
        stretch=one.stretch_s,
        at=0.0,
    )

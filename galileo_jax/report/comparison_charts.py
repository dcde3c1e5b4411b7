"""Charts of a comparison: where along its path the model fails."""

import numpy as np

from galileo_jax.comparison.local_tests import WHOLE
from galileo_jax.comparison.path_residuals import PathResiduals
from galileo_jax.report.chart import Band, Chart, Line, Panel, Points
from galileo_jax.report.fit_charts import residual_panel
from galileo_jax.report.style import object_colour


def failure_chart(one: PathResiduals) -> Chart:
    """Measured (dots) and fitted (line, 95 % band) position and speed, and the residuals.

    Residuals: filled along the path, hollow across it. The interval that fails worst is shaded.
    """
    colour = object_colour(one.index)
    step = np.diff(one.times_s)
    middle = one.times_s[:-1] + step / 2
    position = Panel(
        ylabel="along the path, m",
        title=_title(one),
        marks=(
            Band(one.times_s, one.low_m, one.high_m, colour, "95 % of the model"),
            Line(one.times_s, one.predicted_m, colour, "fitted"),
            Points(one.times_s, one.measured_m, "ink", "measured"),
        ),
        highlights=(one.failing_s,),
    )
    speed = Panel(
        ylabel="speed, m/s",
        marks=(
            Line(middle, np.diff(one.predicted_m) / step, colour, "fitted"),
            Points(middle, np.diff(one.measured_m) / step, "ink", "measured"),
        ),
        highlights=(one.failing_s,),
    )
    label = f"{one.title}: position, speed and residuals of the fit, against time"
    panels = (position, speed, _residuals(one, one.largest))
    return Chart(f"failure_{one.clip}_{one.name}", label, panels, one.clip)


def before_after_chart(
    before: PathResiduals, after: PathResiduals, titles: tuple[str, str]
) -> Chart:
    """The residuals of one object before and after an effect was added, on the same axes."""
    largest = max(before.largest, after.largest)
    panels = tuple(
        _residuals(one, largest, f"{one.title}: {title}")
        for one, title in zip((before, after), titles, strict=True)
    )
    label = f"{after.title}: residuals before and after {titles[1]} was added"
    added = titles[1].replace(", ", "+").replace(" ", "_")
    return Chart(f"before_after_{after.clip}_{after.name}_{added}", label, panels, after.clip)


def _title(one: PathResiduals) -> str:
    if one.worst is None:
        return one.title
    where = "" if one.worst.phase == WHOLE else f", {one.worst.phase}"
    return f"{one.title}: worst in {one.worst.axis}{where} (z = {one.worst.z:.0f})"


def _residuals(one: PathResiduals, largest: float, title: str = "") -> Panel:
    return residual_panel(
        one.times_s,
        {"along the path": one.along, "across the path": one.across},
        one.index,
        title=title,
        phases=one.phases,
        highlight=one.failing_s,
        largest=largest,
    )

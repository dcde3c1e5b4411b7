"""The force that no effect explains, against time, speed and place."""

import numpy as np

from galileo_jax.diagnosis.diagnosis import MissingForce
from galileo_jax.report.chart import Band, Chart, Dots, Line, Mark, Panel, object_colour

NUM_POINTS = 70  # of the scattered ones


def is_told(missing: MissingForce, index: int) -> bool:
    """Whether anything is known of what this object lacks: it was seen moving."""
    return bool(np.isfinite(missing.acceleration_m_s2[index]).any())


def missing_force_chart(missing: MissingForce, index: int, name: str) -> Chart:
    """The acceleration of one object that is missing in the model, with its 95 % band."""
    value, sd = missing.acceleration_m_s2[index], missing.sd_m_s2[index]
    known = np.flatnonzero(np.isfinite(value))
    chosen = known[:: max(1, len(known) // NUM_POINTS)]
    colour = object_colour(index)
    spread = 3 * float(np.median(sd[known]))
    ylim = (min(0.0, value[known].min()) - spread, max(0.0, value[known].max()) + spread)

    def against(values: np.ndarray, what: str, *marks: Mark, title: str = "") -> Panel:
        drawn = marks or (Dots(values[chosen], value[chosen], colour, "missing", sd=sd[chosen]),)
        return Panel("missing, m/s²", drawn, title=title, xlabel=what, ylim=ylim, at=0.0)

    time = missing.time_s
    panels = (
        against(
            time,
            "time since the release, s",
            Band(time, value - 1.96 * sd, value + 1.96 * sd, colour, "95 %", 0.25),
            Line(time, value, colour, "missing"),
            title=name,
        ),
        against(missing.speed_m_s[index], "speed, m/s"),
        against(missing.path_m[index], "along the path, m"),
    )
    label = f"acceleration that the model of {name} lacks, against time, speed and place"
    return Chart(f"missing_{name}", label, panels)

"""The force that no effect explains, against time, speed and place."""

from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.diagnosis.diagnosis import MissingForce
from galileo_jax.report.figure import COLOURS, INK, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SIZE_IN = (4.8, 6.4)
NUM_POINTS = 70  # of the scattered ones


def is_told(missing: MissingForce, index: int) -> bool:
    """Whether anything is known of what this object lacks: it was seen moving."""
    return bool(np.isfinite(missing.acceleration_m_s2[index]).any())


def missing_force_figure(missing: MissingForce, index: int, name: str) -> "Figure":
    """The acceleration of one object that is missing in the model, with its 95 % band."""
    from matplotlib.figure import Figure

    value, sd = missing.acceleration_m_s2[index], missing.sd_m_s2[index]
    known = np.flatnonzero(np.isfinite(value))
    chosen = known[:: max(1, len(known) // NUM_POINTS)]
    colour = COLOURS[index]
    with style(f"missing_{name}"):
        figure = Figure(figsize=SIZE_IN)
        for row, (values, label) in enumerate(
            (
                (missing.time_s, "time since the release, s"),
                (missing.speed_m_s[index], "speed, m/s"),
                (missing.path_m[index], "along the path, m"),
            )
        ):
            axes = figure.add_axes((0.165, 0.73 - 0.325 * row, 0.815, 0.225))
            axes.axhline(0, color=INK, linewidth=0.6)
            if row == 0:
                axes.fill_between(
                    values, value - 1.96 * sd, value + 1.96 * sd, color=colour, alpha=0.25,
                    linewidth=0,
                )  # fmt: skip
                axes.plot(values, value, color=colour)
                axes.set_title(name)
            else:
                axes.errorbar(
                    values[chosen], value[chosen], yerr=1.96 * sd[chosen], fmt="o", color=colour,
                    markersize=2.6, elinewidth=0.4,
                )  # fmt: skip
            spread = 3 * float(np.median(sd[known]))
            axes.set_ylim(
                min(0.0, value[known].min()) - spread, max(0.0, value[known].max()) + spread
            )
            axes.set(xlabel=label, ylabel="missing, m/s²")
    return figure

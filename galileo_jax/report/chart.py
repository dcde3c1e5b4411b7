"""A chart as a description: what is drawn, in which of the page's colours, and nothing of how.

`plotly_chart.py` draws it in a page, `svg_chart.py` as a file.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from galileo_jax.report.phase import Phase

Colour = Literal["object1", "object2", "object3", "ink", "soft", "accent", "fails"]


def object_colour(index: int) -> Colour:
    """Of the object with this index; a fourth has the first's again."""
    return ("object1", "object2", "object3")[index % 3]


@dataclass(frozen=True)
class Line:
    """A curve through `x` and `y`."""

    x: np.ndarray
    y: np.ndarray
    colour: Colour
    name: str
    is_dashed: bool = False
    width_px: float = 1.8


@dataclass(frozen=True)
class Band:
    """The region between `low` and `high`."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    colour: Colour
    name: str
    opacity: float = 0.3


@dataclass(frozen=True)
class Dots:
    """A mark at each `x`, `y`; with `sd` a bar of 1.96 of it to either side."""

    x: np.ndarray
    y: np.ndarray
    colour: Colour
    name: str
    is_hollow: bool = False
    size_px: float = 4.5
    sd: np.ndarray | None = None


Mark = Line | Band | Dots


@dataclass(frozen=True)
class Panel:
    """One pair of axes.

    Attributes:
      ylabel: quantity and unit.
      marks: from the back to the front.
      title: over the axes.
      xlabel: quantity and unit; "" where the panel below has the same axis.
      xlim, ylim: ends of the axes; None = whatever is drawn.
      phases: named on top; passages between phases are shaded.
      stretch: of x, where the model fails.
      at: a level that is drawn as a line.
    """

    ylabel: str
    marks: tuple[Mark, ...]
    title: str = ""
    xlabel: str = ""
    xlim: tuple[float, float] | None = None
    ylim: tuple[float, float] | None = None
    phases: tuple[Phase, ...] = ()
    stretch: tuple[float, float] | None = None
    at: float | None = None


@dataclass(frozen=True)
class Chart:
    """Panels, one below the other.

    Attributes:
      name: of its file.
      label: what is seen, for those who do not see it.
      panels: they share x where only the last has an `xlabel`.
      clip: whose time is on x; None = x is not a clip's time.
    """

    name: str
    label: str
    panels: tuple[Panel, ...]
    clip: str | None = None

    @property
    def shares_x(self) -> bool:
        """Whether all panels have the x axis of the last."""
        return not any(panel.xlabel for panel in self.panels[:-1])


SHADED = ("held", "foot", "collision")
LETTER = 0.021  # of the panel's width, what a letter of a phase's name takes


def is_named(phase: Phase, xlim: tuple[float, float]) -> bool:
    """Whether a phase is wide enough for its name."""
    return phase.end_s - phase.start_s > LETTER * len(phase.name) * (xlim[1] - xlim[0])


def time_limits(times_s: np.ndarray) -> tuple[float, float]:
    """The clip's time with a little room."""
    spare = 0.02 * float(times_s[-1] - times_s[0])
    return float(times_s[0]) - spare, float(times_s[-1]) + spare

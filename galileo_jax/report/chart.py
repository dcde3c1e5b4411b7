"""A chart as a description: what is drawn and in which colours, but not with which library.

`draw.py` turns it into a Plotly figure (pages, notebooks) or an SVG document (papers, slides).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from galileo_jax.comparison.phases import Phase

Values = np.ndarray | Sequence[float] | Sequence[str]  # str: categories


@dataclass(frozen=True)
class Line:
    """A curve through `x` and `y`."""

    x: Values
    y: Values
    colour: str
    name: str
    is_dashed: bool = False
    width_px: float = 1.8
    opacity: float = 1.0


@dataclass(frozen=True)
class Band:
    """The region between `low` and `high`."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    colour: str
    name: str
    opacity: float = 0.3


@dataclass(frozen=True)
class Points:
    """A mark at each `x`, `y`; with `sd` a bar of 1.96 of it to either side."""

    x: Values
    y: Values
    colour: str
    name: str
    is_hollow: bool = False
    size_px: float = 4.5
    sd: np.ndarray | None = None
    opacity: float = 1.0


@dataclass(frozen=True)
class Bars:
    """Bars of these heights at `x`, with texts at their ends; horizontal ones start at x = 0."""

    x: Values
    height: Values
    colour: str
    name: str
    width: float = 0.6
    texts: tuple[str, ...] = ()
    is_horizontal: bool = False
    opacity: float = 1.0


@dataclass(frozen=True)
class Boxes:
    """Box plots of the `y` in each category of `x`, with all values as points.

    They stand beside those of other series, or over them.
    """

    x: Sequence[str]
    y: Sequence[float]
    colour: str
    name: str
    is_beside: bool = False


Mark = Line | Band | Points | Bars | Boxes
SHADED_PHASES = ("held", "foot", "collision")
LETTER = 0.021  # of the panel's width, what a letter of a phase's name takes
NAMES_ROOM = 0.14  # of a panel's height, for the phases' names
# Sizes in px.
TITLE_PX, PLAIN_PX, LABEL_PX, END_PX, LEFT_PX, RIGHT_PX = 30, 12, 46, 26, 58, 12
ALONE_PX, STACKED_PX, PANEL_PX, CELL_PX = 210, 150, 410, 100
LETTER_PX, SLANTED_PX, SLANT_DEG = 6.5, 4.5, 35  # of the names of categories


@dataclass(frozen=True)
class Panel:
    """One pair of axes."""

    ylabel: str  # quantity and unit
    marks: tuple[Mark, ...]  # from the back to the front
    title: str = ""  # over the axes
    xlabel: str = ""  # quantity and unit; "" where the panel below has the same axis
    # Ends of the axes; None = whatever is drawn.
    xlim: tuple[float, float] | None = None
    ylim: tuple[float, float] | None = None
    is_log_y: bool = False  # the y axis is logarithmic; it has no `ylim` then
    has_y_ticks: bool = True  # whether the y axis has numbers
    phases: tuple[Phase, ...] = ()  # named on top; passages between phases are shaded
    # Of x, where the model fails; None: nowhere.
    highlights: tuple[tuple[float, float] | None, ...] = ()
    level: float | None = None  # of y, drawn as a line
    divider: tuple[float, str] | None = None  # x at which a line with a name is drawn

    @property
    def spans(self) -> list[tuple[float, float, str, float]]:
        """What is shaded: start and end in x, colour, opacity."""
        found = [(p.start_s, p.end_s, "ink", 0.06) for p in self.phases if p.name in SHADED_PHASES]
        return found + [(*one, "fails", 0.3) for one in self.highlights if one is not None]

    @property
    def names(self) -> list[tuple[float, str]]:
        """The names of the phases that are wide enough for them, and the x of their middles."""
        if self.xlim is None:
            return []
        letter = LETTER * (self.xlim[1] - self.xlim[0])
        return [
            ((phase.start_s + phase.end_s) / 2, phase.name)
            for phase in self.phases
            if phase.end_s - phase.start_s > letter * len(phase.name)
        ]


@dataclass(frozen=True)
class Chart:
    """Panels in a grid."""

    name: str  # of its file
    label: str  # what is seen, for those who do not see it
    # Row by row; None leaves a place empty. The panels of a column share x where only the last has
    # an `xlabel`.
    panels: tuple[Panel | None, ...]
    clip: str | None = None  # whose time is on x; None = x is not the time of a clip
    columns: int = 1  # of the grid
    # Height of a panel; None = as one or several panels usually have it.
    panel_px: int | None = None

    @property
    def rows(self) -> list[tuple[Panel | None, ...]]:
        """The grid."""
        step = self.columns
        return [self.panels[i : i + step] for i in range(0, len(self.panels), step)]

    @property
    def marks(self) -> list[Mark]:
        """Of all panels."""
        return [mark for panel in self.panels if panel for mark in panel.marks]

    @property
    def shares_x(self) -> bool:
        """Whether the panels of a column have the x axis of the last."""
        return not any(p.xlabel for p in chain.from_iterable(self.rows[:-1]) if p)


def side_by_side(name: str, label: str, charts: Sequence[Chart]) -> Chart:
    """Charts of equally many panels, each one below the other, as the columns of one."""
    rows = zip(*(chart.panels for chart in charts), strict=True)
    return Chart(name, label, tuple(chain.from_iterable(rows)), columns=len(charts))


def stacked(name: str, label: str, panels: Iterable[Panel], panel_px: int | None = None) -> Chart:
    """Panels of one quantity each, one below the other over one x axis."""
    *upper, last = panels
    joined = (*(replace(panel, xlabel="") for panel in upper), last)
    return Chart(name, label, joined, panel_px=panel_px)


def time_limits(times_s: np.ndarray | Sequence[float]) -> tuple[float, float]:
    """The clip's time with a little room."""
    spare = 0.02 * float(times_s[-1] - times_s[0])
    return float(times_s[0]) - spare, float(times_s[-1]) + spare


def with_room(low: float, high: float) -> tuple[float, float]:
    """The ends of an axis with room for the phases' names."""
    return low, high + NAMES_ROOM * (high - low)


@dataclass(frozen=True)
class Layout:
    """Sizes in px: the figure, its margins, the gaps between panels, the panels."""

    width: float
    height: float
    top: float
    bottom: float
    left: float
    row_gap: float
    column_gap: float
    panel_width: float
    panel_height: float


def layout_of(chart: Chart) -> Layout:
    """How large it is drawn."""
    first, *lower = chart.rows
    beside = [panel for row in chart.rows for panel in row[1:] if panel]
    is_narrow = bool(beside) and not any(panel.has_y_ticks for panel in beside)
    column_gap = PLAIN_PX if is_narrow else LEFT_PX + RIGHT_PX
    panel_width = CELL_PX if is_narrow else PANEL_PX
    lower_top = TITLE_PX if any(p and p.title for row in lower for p in row) else PLAIN_PX
    row_gap = lower_top if chart.shares_x else LABEL_PX + lower_top
    panel_height = chart.panel_px or (STACKED_PX if lower else ALONE_PX)
    marks = chart.marks
    on_x = [len(name) for mark in marks if isinstance(mark, Boxes) for name in mark.x]
    on_y = [len(str(x)) for mark in marks if isinstance(mark, Bars) and mark.is_horizontal
            for x in mark.x]  # fmt: skip
    top = TITLE_PX if any(panel and panel.title for panel in first) else PLAIN_PX
    bottom = LABEL_PX if any(panel and panel.xlabel for panel in chart.rows[-1]) else END_PX
    bottom += SLANTED_PX * max(on_x, default=0)
    left = max(LEFT_PX, LETTER_PX * max(on_y, default=0))
    rows, columns = len(chart.rows), chart.columns
    return Layout(
        width=left + columns * (panel_width + column_gap) - column_gap + RIGHT_PX,
        height=top + rows * (panel_height + row_gap) - row_gap + bottom,
        top=top,
        bottom=bottom,
        left=left,
        row_gap=row_gap,
        column_gap=column_gap,
        panel_width=panel_width,
        panel_height=panel_height,
    )

"""The sizes of a chart and its parts, px; both ways of drawing follow them."""

from dataclasses import dataclass

from galileo_jax.report.chart import Bars, Boxes, Chart

TITLE_PX, PLAIN_PX, LABEL_PX, END_PX, LEFT_PX, RIGHT_PX = 30, 12, 46, 26, 58, 12
ALONE_PX, STACKED_PX, PANEL_PX, CELL_PX = 210, 150, 410, 100
LETTER_PX, SLANTED_PX, SLANT_DEG = 6.5, 4.5, 35  # of the names of categories


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

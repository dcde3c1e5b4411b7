"""The look of all figures, and how they become SVG for a file and for the page."""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

INK, PAPER = "#22242a", "#ffffff"  # in the page: the text's colour, and none
COLOURS = ("#c2592f", "#3273b3", "#59994d")  # objects 1, 2 (as in scenes/ramp.xml), 3 (scene.py)
PANEL_IN = (4.8, 2.7)  # one panel is a phone's width

PX_PER_PT = 4 / 3
_STYLE: dict[str, Any] = {
    "svg.fonttype": "none",  # the page's own font
    "font.family": "sans-serif",
    "font.size": 9.5,
    "text.color": INK,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "lines.linewidth": 1.5,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": PAPER,
    "axes.facecolor": "none",
    "savefig.facecolor": PAPER,
}


@contextmanager
def style(name: str) -> Iterator[None]:
    """The figures' look; `name` makes a figure's SVG the same in every run."""
    import matplotlib

    with matplotlib.rc_context(_STYLE | {"svg.hashsalt": name}):  # pyright: ignore
        yield


def panel(title: str, xlabel: str, ylabel: str) -> tuple["Figure", "Axes"]:
    """A figure of one panel."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=PANEL_IN)
    axes = figure.add_axes((0.165, 0.165, 0.815, 0.735))
    axes.set(title=title, xlabel=xlabel, ylabel=ylabel)
    return figure, axes


def to_svg(figure: "Figure", name: str) -> str:
    """The figure as an SVG document, the same text for the same figure."""
    stream = io.StringIO()
    with style(name):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()


def to_inline(svg: str, label: str) -> str:
    """An SVG document as an element of the page, in the page's colours."""
    element = svg[svg.index("<svg") :]
    element = re.sub(r"<metadata>.*?</metadata>", "", element, flags=re.DOTALL)
    if found := re.search(r'<svg[^>]*? width="([\d.]+)pt"', element):
        # No larger than it was drawn: a small figure's words would be.
        natural = f'<svg style="--natural: {float(found[1]) * PX_PER_PT:.0f}px"'
        element = element.replace("<svg", natural, 1)
    element = re.sub(r'(<svg[^>]*?) width="[^"]*pt"', r"\1", element, count=1)
    element = re.sub(r'(<svg[^>]*?) height="[^"]*pt"', r"\1", element, count=1)
    element = element.replace(INK, "currentColor").replace(f"fill: {PAPER}", "fill: none")
    return element.replace("<svg", f'<svg role="img" aria-label="{label}"', 1)

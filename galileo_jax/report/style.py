"""The colours of pages and figures, and how Matplotlib draws with them.

`page.css` defines the colours once; everything else reads them from there.
"""

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OBJECTS = ("object1", "object2", "object3")


@cache
def palette(is_dark: bool = False) -> dict[str, str]:
    """`#rrggbb` by name, as the style sheet has it for light or for dark pages."""
    css = resources.files("galileo_jax.report").joinpath("page.css").read_text(encoding="utf-8")
    rule = css.split("}")[1 if is_dark else 0]
    return dict(re.findall(r"--(\w+): (#[0-9a-f]{6});", rule))


def object_colour(index: int) -> str:
    """The name of the colour of the object with this index; a fourth has the first's again."""
    return OBJECTS[index % len(OBJECTS)]


@contextmanager
def matplotlib_style(name: str) -> Iterator[None]:
    """The look of static figures; `name` makes the SVG of a figure the same in every run."""
    import matplotlib

    ink = palette()["ink"]
    coloured = ("text.color", "axes.edgecolor", "axes.labelcolor", "axes.titlecolor",
                "xtick.color", "ytick.color")  # fmt: skip
    style: dict[str, Any] = {
        **dict.fromkeys(coloured, ink),
        "svg.fonttype": "none",  # the font of the document that shows it
        "svg.hashsalt": name,
        "font.family": "sans-serif",
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "axes.titlelocation": "left",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.linewidth": 0.6,
        "axes.facecolor": "none",
        "xtick.major.width": 0.6,
        "ytick.major.width": 0.6,
        "lines.linewidth": 1.5,
        "legend.frameon": False,
        "legend.fontsize": 8.5,
    }
    with matplotlib.rc_context(style):  # pyright: ignore
        yield


def save_svg(figure: "Figure", name: str) -> str:
    """The figure as an SVG document, the same text for the same figure."""
    stream = io.StringIO()
    with matplotlib_style(name):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()

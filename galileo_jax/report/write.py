"""Writing the report of a run: plots in DIR/plots, the page in DIR/report.html."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from galileo_jax.files import write_text
from galileo_jax.report.draws import pair_figure, trace_figure
from galileo_jax.report.figure import to_inline, to_svg
from galileo_jax.report.fitted import Fitted, evaluate
from galileo_jax.report.page import render
from galileo_jax.report.profiles import AXES, position_figure, velocity_figure
from galileo_jax.report.residuals import residual_figure
from galileo_jax.run import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, PLOTS = "report.html", "plots"


def write_report(run: Run) -> Path:
    """Writes a finished fit's plots (SVG) and its page; returns the page's path."""
    fitted = evaluate(run, seed=int(run.result["seed"]))
    inline: dict[str, dict[str, str]] = {}
    for section, name, figure in _figures(run, fitted):
        svg = to_svg(figure, name)
        write_text(run.folder / PLOTS / f"{name}.svg", svg)
        inline.setdefault(section, {})[name] = to_inline(svg, name.replace("_", " "))
    names = {name for section in inline.values() for name in section}
    for path in (run.folder / PLOTS).glob("*.svg"):
        if path.stem not in names:  # of an earlier fit into the same folder
            path.unlink()
    page = run.folder / PAGE
    write_text(page, render(run, fitted, inline))
    return page


def _figures(run: Run, fitted: Fitted) -> Iterator[tuple[str, str, "Figure"]]:
    """Section, name and figure, one by one."""
    objects = list(enumerate(fitted.observation.names))
    for i, name in objects:
        for axis, letter in enumerate(AXES):
            yield "velocity", f"velocity_{name}_{letter}", velocity_figure(fitted, i, axis)
    for i, name in objects:
        for axis, letter in enumerate(AXES):
            yield "position", f"position_{name}_{letter}", position_figure(fitted, i, axis)
    for i, name in objects:
        yield "residuals", f"residuals_{name}", residual_figure(fitted, i)
    names = [p.name for p in run.problem.parameters if p.role != "nuisance"]
    yield "draws", "pairs", pair_figure(run.posterior, names)
    if run.result["method"] == "mh":
        yield "draws", "trace", trace_figure(run.posterior, names)

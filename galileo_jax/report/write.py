"""Writing the report of a run: plots in DIR/plots, the page in DIR/report.html."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from galileo_jax.report.animation import animation
from galileo_jax.report.chart import Chart
from galileo_jax.report.draws import pair_figure, trace_figure
from galileo_jax.report.figure import to_inline, to_svg
from galileo_jax.report.fitted import Fitted, evaluate
from galileo_jax.report.page import render
from galileo_jax.report.plotly_chart import chart_element
from galileo_jax.report.profiles import AXES, position_chart, velocity_chart
from galileo_jax.report.residuals import residual_chart
from galileo_jax.report.svg_chart import chart_svg
from galileo_jax.results.run import Run
from galileo_jax.results.shown_parameters import shown_parameters
from galileo_jax.runtime.atomic_write import write_text

PAGE, PLOTS = "report.html", "plots"
OURS = ("velocity_", "position_", "residuals_", "pairs", "trace")  # names of plots begin so


def write_report(run: Run, page: Path | None = None) -> Path:
    """Writes a finished fit's page, and its plots (SVG) beside it; returns the page's path.

    Args:
      run: the fit.
      page: where to; default: report.html in the run's folder.
    """
    page = page or run.folder / PAGE
    fitted = evaluate(run, seed=int(run.result["seed"]))
    shown: dict[str, dict[str, str]] = {}
    files: dict[str, str] = {}
    for section, chart in _charts(run, fitted):
        files[chart.name] = chart_svg(chart)
        shown.setdefault(section, {})[chart.name] = chart_element(chart)
    for name, svg in _draws(run):
        files[name] = svg
        shown.setdefault("draws", {})[name] = to_inline(svg, f"{name} of the posterior's draws")
    for name, svg in files.items():
        write_text(page.parent / PLOTS / f"{name}.svg", svg)
    for path in (page.parent / PLOTS).glob("*.svg"):
        if path.stem.startswith(OURS) and path.stem not in files:  # of an earlier fit
            path.unlink()
    model = ", ".join(run.result["effects"]) or "fitted"
    centres = np.median(fitted.position_m, axis=0) - fitted.offset_m[..., None]
    shown["motion"] = {run.problem.name: animation(run.clip, run.problem, {model: centres})}
    write_text(page, render(run, fitted, shown))
    return page


def _charts(run: Run, fitted: Fitted) -> Iterator[tuple[str, Chart]]:
    """Section and chart, one by one."""
    objects, clip = range(len(fitted.observation.names)), run.problem.name
    for i in objects:
        for axis in range(len(AXES)):
            yield "velocity", velocity_chart(fitted, i, axis, clip)
    for i in objects:
        yield "residuals", residual_chart(fitted, i, clip)
    for i in objects:
        for axis in range(len(AXES)):
            yield "position", position_chart(fitted, i, axis, clip)


def _draws(run: Run) -> Iterator[tuple[str, str]]:
    """Name and SVG: pairs of parameters and, of chains, their way."""
    main = [p.name for p in run.problem.parameters if p.role != "nuisance"]
    shown = shown_parameters(run.result)
    names = [name for name in main if name in shown] or main
    yield "pairs", to_svg(pair_figure(run.posterior, names), "pairs")
    if run.result["method"] == "mh":
        yield "trace", to_svg(trace_figure(run.posterior, names), "trace")

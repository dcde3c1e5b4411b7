"""The figures of a fit as SVG files, for papers and slides: what `galileo export --to svg` writes.

A fit does not write them itself: drawing eleven of them takes as long as fitting a track.
"""

from pathlib import Path

from galileo_jax.prediction.posterior_predictive import posterior_predictive
from galileo_jax.report.draw import to_svg
from galileo_jax.report.fit_page import fit_charts
from galileo_jax.results.run import Run
from galileo_jax.runtime.atomic_write import write_text


def write_fit_plots(run: Run, folder: Path) -> list[Path]:
    """Writes the figures of a fit's page; returns the files.

    Args:
      run: the fit.
      folder: made where it is not there.
    """
    fitted = posterior_predictive(run, seed=int(run.result["seed"]))
    written = []
    for chart in (chart for some in fit_charts(run, fitted).values() for chart in some):
        written.append(folder / f"{chart.name}.svg")
        write_text(written[-1], to_svg(chart))
    return written

"""Charts of the posterior's draws: pairs of parameters and, of chains, their traces."""

import re
from itertools import pairwise

import numpy as np

from galileo_jax.inference.posterior import Posterior
from galileo_jax.report.chart import Bars, Chart, Line, Panel, Points, stacked
from galileo_jax.report.style import OBJECTS

NUM_PAIRS, NUM_TRACE = 800, 400  # points of a panel, of a chain
NUM_BINS = 30
PANEL_PX, TRACE_PX = 88, 90
CHAIN_COLOURS = (*OBJECTS, "ink")


def main_draws(posterior: Posterior, names: list[str]) -> dict[str, np.ndarray]:
    """`[chain, draw]` by name: the given parameters and the ratios of neighbours' masses."""
    shown = {name: posterior[name] for name in names}
    masses = [name for name in names if re.fullmatch(r"m\d+", name)]
    ratios = {f"{a} / {b}": posterior[a] / posterior[b] for a, b in pairwise(masses)}
    return shown | ratios


def pair_chart(posterior: Posterior, names: list[str]) -> Chart:
    """Every pair of the main parameters; on the diagonal each one's histogram."""
    columns = {key: value.reshape(-1) for key, value in main_draws(posterior, names).items()}
    panels = []
    for row, y_name in enumerate(columns):
        for column, x_name in enumerate(columns):
            if column > row:
                panels.append(None)
                continue
            x, y = columns[x_name], columns[y_name]
            stride = max(1, x.size // NUM_PAIRS)
            mark = _histogram(x_name, x)
            if row != column:
                mark = Points(x[::stride], y[::stride], "object2", f"{x_name}, {y_name}",
                              size_px=3, opacity=0.35)  # fmt: skip
            panels.append(
                Panel(
                    ylabel=y_name if column == 0 and row > 0 else "",
                    marks=(mark,),
                    xlabel=x_name if row == len(columns) - 1 else "",
                    has_y_ticks=column == 0 and row > 0,
                )
            )
    label = "draws of the posterior, pairs of parameters"
    return Chart("pairs", label, tuple(panels), columns=len(columns), panel_px=PANEL_PX)


def _histogram(name: str, values: np.ndarray) -> Bars:
    bins = NUM_BINS if np.ptp(values) > 1e-6 * np.abs(values).max() else 1  # a stuck chain
    counts, edges = np.histogram(values, bins)
    width = float(edges[1] - edges[0])
    return Bars(edges[:-1] + width / 2, counts, "object2", name, width, opacity=0.75)


def trace_chart(posterior: Posterior, names: list[str]) -> Chart:
    """The main parameters of every chain, draw by draw."""
    panels = []
    for name, chains in main_draws(posterior, names).items():
        index = np.arange(chains.shape[1])[:: max(1, chains.shape[1] // NUM_TRACE)]
        lines = tuple(
            Line(index, chain[index], CHAIN_COLOURS[i % len(CHAIN_COLOURS)], f"chain {i + 1}",
                 width_px=0.7, opacity=0.6)
            for i, chain in enumerate(chains)
        )  # fmt: skip
        panels.append(Panel(name, lines, xlabel="draw"))
    label = "draws of the posterior against their number, chain by chain"
    return stacked("trace", label, panels, panel_px=TRACE_PX)

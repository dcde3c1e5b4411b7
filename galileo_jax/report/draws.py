"""The posterior's draws: pairs of parameters and, of chains, their traces."""

import re
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from galileo_jax.inference.posterior import Posterior
from galileo_jax.report.figure import COLOURS, INK, style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NUM_SHOWN = 800
CELL_IN = 1.25


def main_draws(posterior: Posterior, names: list[str]) -> dict[str, np.ndarray]:
    """`[chain, draw]` by name: the given parameters and the ratios of neighbours' masses."""
    shown = {name: posterior[name] for name in names}
    masses = [name for name in names if re.fullmatch(r"m\d+", name)]
    ratios = {f"{a} / {b}": posterior[a] / posterior[b] for a, b in pairwise(masses)}
    return shown | ratios


def pair_figure(posterior: Posterior, names: list[str]) -> "Figure":
    """Every pair of the main parameters; a straight diagonal shows a ridge."""
    from matplotlib.figure import Figure

    columns = {key: value.reshape(-1) for key, value in main_draws(posterior, names).items()}
    count = len(columns)
    stride = max(1, next(iter(columns.values())).size // NUM_SHOWN)
    with style("pairs"):
        size = max(2.4, CELL_IN * count + 0.5)
        figure = Figure(figsize=(size, size), dpi=144)
        grid = figure.subplots(count, count, squeeze=False, sharex="col")
        figure.subplots_adjust(0.6 / size, 0.5 / size, 1 - 0.1 / size, 1 - 0.1 / size, 0.12, 0.12)
        for row, (y_name, y) in enumerate(columns.items()):
            for column, (x_name, x) in enumerate(columns.items()):
                axes = grid[row, column]
                if column > row:
                    axes.set_visible(False)
                    continue
                axes.tick_params(labelsize=7, length=2)
                axes.locator_params(axis="x", nbins=2)
                axes.locator_params(axis="y", nbins=3)
                if row == column:
                    bins = 30 if np.ptp(x) > 1e-6 * np.abs(x).max() else 1  # a stuck chain
                    axes.hist(x, bins=bins, color=COLOURS[1], alpha=0.75, histtype="stepfilled")
                    axes.set_yticks([])
                    axes.spines["left"].set_visible(False)
                else:
                    axes.scatter(
                        x[::stride], y[::stride], s=2.5, color=COLOURS[1], alpha=0.35,
                        linewidths=0, rasterized=True,
                    )  # fmt: skip
                if column == 0 and row > 0:
                    axes.set_ylabel(y_name)
                elif row != column:
                    axes.set_yticklabels([])
                if row == count - 1:
                    axes.set_xlabel(x_name)
    return figure


def trace_figure(posterior: Posterior, names: list[str]) -> "Figure":
    """Every chain's way through the main parameters."""
    from matplotlib.figure import Figure

    shown = main_draws(posterior, names)
    with style("trace"):
        height = 0.6 + 1.1 * len(shown)
        figure = Figure(figsize=(6.8, height))
        grid = figure.subplots(len(shown), 1, squeeze=False, sharex=True)[:, 0]
        figure.subplots_adjust(0.12, 0.5 / height, 0.98, 1 - 0.1 / height)
        for axes, (name, chains) in zip(grid, shown.items(), strict=True):
            stride = max(1, chains.shape[1] // NUM_SHOWN)
            index = np.arange(chains.shape[1])[::stride]
            for i, chain in enumerate(chains):
                axes.plot(index, chain[::stride], linewidth=0.5, alpha=0.6, color=_shade(i))
            axes.set_ylabel(name)
            axes.locator_params(axis="y", nbins=4)
        grid[-1].set_xlabel("draw")
    return figure


def _shade(chain: int) -> str:
    return (*COLOURS, INK)[chain % 4]

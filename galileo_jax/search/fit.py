"""The fit of one model: the same search, with no hypothesis beside it.

From a single distant start a descent usually ends in a side valley, because the time of a hit
decides which frames are compared with which. So the moves scatter starts, jolt the fit across rims,
and, where it is in doubt, look phase by phase and on all sides. What has come to rest then looks
round itself (`to_go_on_from`).
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.inference.fit_posterior import to_go_on_from
from galileo_jax.inference.fits.gradient import Code, GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.search.loop import search
from galileo_jax.search.moves import jolt, prefix
from galileo_jax.search.table import BASE, CHANGED_NATS, Entry, Stakes, Start, Table

NUM_LOOKS = 3  # round a fit, each from a better one


def best_fit(
    fitter: GradientFitter,
    seed: int,
    on_stage: Callable[[str], None] = lambda _: None,
    effects: Sequence[str] | None = None,
    is_enough: Callable[[GradientFit], bool] | None = None,
) -> GradientFit:
    """The most evident fit of a model, with the valleys beside it; the same for the same seed.

    `effects`: names of the effects that are there; default: all of the models'. `is_enough`: of
    what was found, whether more starts are spared; default: whether noise explains what it leaves.
    """
    trials = fitter.trials
    mask = trials.free(trials.all_effects if effects is None else effects)

    def on_round(starts: Sequence[Start]) -> None:
        is_first = any(one.parent is None for one in starts)
        is_second = any(one.move == prefix.NAME for one in starts)
        on_stage("searching" if is_first else "searching on" if is_second else "refining")

    table = search(_empty(fitter, seed, mask, is_enough), 0, on_round=on_round)
    table, fit = looked_round(table)
    if fit.code is Code.CONVERGED and not fitter.is_explained(fit, NOISE_SCALE_RANGE[1]):
        fit = fit if table.is_explained(table.base) else replace(fit, code=Code.MISFIT)
    return replace(fit, stats={**fit.stats, "num_rollouts": fitter.residuals.num_rollouts})


def refit(fitter: GradientFitter, fit: GradientFit) -> GradientFit:
    """The best of a fit gone on from and of those with its positive nuisances moved."""
    start = Start((), fit.z[: len(fit.steps)], None, "refit", is_near=True)
    table = _empty(fitter, 0, fit.free)
    return search(table, 0, starts=[start], moves=[jolt.propose]).base.fit


def _empty(
    fitter: GradientFitter,
    seed: int,
    mask: np.ndarray,
    is_enough: Callable[[GradientFit], bool] | None = None,
) -> Table:
    """A table in which nothing has been found yet; `mask`: of all parameters."""
    is_enough = is_enough or fitter.is_explained
    is_explained = functools.cache(lambda one: is_enough(one.fit))
    count = len(fitter.trials.model_parameters)
    return Table(fitter, Stakes(), seed, {}, is_explained, mask[:count])


def looked_round(table: Table) -> tuple[Table, GradientFit]:
    """The table with what is found round its fit, and that fit, standing still."""
    fitter = table.fitter
    fit = fitter.at_rest(table.entries[BASE].fits)
    for _ in range(NUM_LOOKS if fitter.is_smooth else 0):
        starts = to_go_on_from(fitter.trials, (fit, *fit.beside), fitter.residuals, table.seed)
        if not len(starts):
            break
        base = Hypothesis((), fit)
        near = [Start((), z, base, "look", i, is_near=True) for i, z in enumerate(starts)]
        known = table.with_entry(Entry(base, (fit, *fit.beside)))
        table = search(known, 0, starts=near)
        before, fit = fit.log_evidence, fitter.at_rest(table.entries[BASE].fits)
        if not fit.log_evidence - before > CHANGED_NATS:  # nor if both failed
            break
    return table, fit

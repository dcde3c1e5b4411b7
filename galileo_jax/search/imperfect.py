"""Fits with imperfections whose sizes are inferred, and the choice between that and an exact world.

Sizes and parameters are fitted by turns (`linear_clip`, `GradientFitter.continued`). Whether the
world is exact or not is as probable beforehand; the evidence of both says what it is afterwards.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from galileo_jax.inference.fits.gradient import Code, GradientFit, GradientFitter
from galileo_jax.inference.fits.linear_clip import (
    expected_lead,
    integrated,
    linear_clips,
    most_probable,
)
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.search.fit import best_fit

MOST_ROUNDS, SETTLED = 4, 0.02  # of sizes and fits by turns; of a log size
HOPELESS = -4.0  # nats, by Laplace: then what more care would change leaves it excluded
EXCLUDED = 0.05  # a world that is less probable has no part in the posterior


@dataclass(frozen=True)
class World:
    """One of several descriptions of the same clips: trials and the fit of them."""

    trials: JointProblem
    fit: GradientFit


@dataclass(frozen=True)
class Worlds:
    """What clips may show, the more probable first."""

    best: World  # the more probable
    exact: GradientFit  # the fit in an exact world, whatever the data say of it
    other: World | None = None  # the less probable; None where it has no part in the posterior
    share: float = 0.0  # the probability of the less probable


def fit_worlds(
    trials: JointProblem,
    seed: int,
    on_stage: Callable[[str], None] = lambda _: None,
    may_be_exact: bool = True,
) -> Worlds:
    """The fit with imperfections, and the one in an exact world beside it or before it.

    It is searched for in the exact world, where valleys are narrow and far apart. A second search
    is spared where imperfections of usual sizes explain what the first one leaves. What no
    imperfection explains is fitted exactly, so that it shows where the model fails.

    `may_be_exact`: whether an exact world is possible at all.
    """
    fitter = GradientFitter(trials)

    def is_enough(fit: GradientFit) -> bool:
        if fitter.is_explained(fit):
            return True
        rough = with_imperfections(trials, fit, to_rest=False).fit
        is_usual = rough.sizes is not None and not rough.sizes.unusual
        return is_usual and rough.code is Code.CONVERGED

    exact = World(trials, best_fit(fitter, seed, on_stage, is_enough=is_enough))
    on_stage("sizing imperfections")
    x = None
    if may_be_exact and trials.terms and exact.fit.code is Code.CONVERGED:
        clips = linear_clips(trials, exact.fit)
        modes = most_probable(clips, trials.terms, None, exact.fit)
        lead = expected_lead(clips, modes, exact.fit)
        if lead < HOPELESS:
            return Worlds(exact, exact.fit, share=float(expit(lead)))
        x = [mode.x for mode in modes]
    rough = with_imperfections(trials, exact.fit, x)
    if not may_be_exact or rough.fit.sizes is None:
        return Worlds(rough, exact.fit)
    if rough.fit.code is not Code.CONVERGED:
        return Worlds(exact, exact.fit)
    probability = float(expit(rough.fit.log_evidence - exact.fit.log_evidence))
    if exact.fit.code is not Code.CONVERGED:
        return Worlds(rough, exact.fit)
    best, other = (rough, exact) if probability > 0.5 else (exact, rough)
    share = min(probability, 1 - probability)
    return Worlds(best, exact.fit, other if share > EXCLUDED else None, share)


def with_imperfections(
    trials: JointProblem,
    fit: GradientFit,
    x: Sequence[np.ndarray] | None = None,
    to_rest: bool = True,
) -> World:
    """The trials with the sizes of imperfections that a fit asks for, and the fit with these.

    `fit`: of them, with the valleys beside it. `x`: `[term]` each, where to begin to look for
    sizes, if that is known. `to_rest`: whether the fit goes on until it stands still.
    """
    terms = trials.terms
    if not terms or fit.code is Code.FAILED:
        return World(trials, fit)
    starts, known = x, np.full(len(terms), np.inf)
    for i in range(MOST_ROUNDS):
        modes = most_probable(linear_clips(trials, fit), terms, starts, fit)
        is_last = np.abs(modes[0].x - known).max() < SETTLED or i == MOST_ROUNDS - 1
        known = modes[0].x
        starts = [mode.x for mode in modes]
        by_name = dict(zip((term.name for term in terms), modes[0].x.tolist(), strict=True))
        trials = trials.with_sizes(by_name)
        fit = GradientFitter(trials).continued(fit, to_rest and is_last)
        if is_last or fit.code is Code.FAILED:
            break
    sizes = integrated(linear_clips(trials, fit), terms, modes)
    more = sizes.log_evidence
    beside = tuple(replace(one, log_evidence=one.log_evidence + more) for one in fit.beside)
    fit = replace(fit, sizes=sizes, log_evidence=fit.log_evidence + more, beside=beside)
    return World(trials, fit)

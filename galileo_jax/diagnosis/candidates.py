"""Candidates: every effect of the library as a hypothesis, all fitted in one batch.

For each candidate first a score test, at no strength at all: how much would the misfit fall
along the effect's slope, what the other parameters take up already left out? It needs one
rollout each. Then a joint fit with all other parameters, from several starts, and the evidence
of the hypothesis by Laplace's method: it charges for every parameter by how much of its prior
the data rule out.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from scipy.special import ndtri

from galileo_jax.comparison.bootstrap import whitened
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.trials import Trials
from galileo_jax.parameters import inverse

STARTS_PER_PARAMETER, MOST_STARTS = 32, 96
NUM_WAYS = 3  # in which they relate to the fit without the candidate; the best of each is refined
# Of a strength's prior: small enough to be a slope, large enough to be seen.
PROBE_Z = 0.1
SMALL_QUANTILE_Z = -2.0
NUM_REFITTED = 3
SPREAD_Z = 0.7  # of starts round the fit without the candidate


@dataclass(frozen=True)
class Hypothesis:
    """Effects that are there, and the fit with them.

    Attributes:
      effects: names, in the order in which they were added.
      fit: of all parameters.
    """

    effects: tuple[str, ...]
    fit: GradientFit


def fit_candidates(
    fitter: GradientFitter, base: Hypothesis, candidates: Sequence[tuple[str, ...]], seed: int
) -> list[Hypothesis]:
    """Fits every candidate (a set of effects) in one batch.

    Args:
      fitter: of trials whose models have the whole library.
      base: a fit with fewer effects, to start from.
      candidates: names of all effects of each.
      seed: of the starts.
    """
    trials = fitter.trials
    count = len(trials.model_parameters)
    free = np.stack([trials.free(effects)[:count] for effects in candidates])
    starts, owner = [], []
    for i, row in enumerate(free):
        starts.append(_starts(trials, base.fit, row, seed))
        owner.append(np.full(len(starts[-1]), i))
    z, of = np.concatenate(starts), np.concatenate(owner)
    costs = fitter.search_costs(z, free[of])
    chosen = []
    for i in range(len(candidates)):
        for way in range(NUM_WAYS):
            own = np.flatnonzero(of == i)[way::NUM_WAYS]
            chosen.append(own[np.argmin(costs[own])])
    fits = fitter.fit_from(z[chosen], free[of[chosen]], of[chosen])
    # The winners are looked at once more: their order must not hang on a side valley.
    # The search's coarse noise cannot say which of a candidate's starts ends best, either.
    winners = np.argsort([-fit.log_evidence for fit in fits])[:NUM_REFITTED]
    rows = np.concatenate([np.array(chosen)[of[chosen] == i] for i in winners])
    again = fitter.fit_from(z[rows], free[of[rows]], np.arange(len(rows)))
    for i in winners:
        tried = [fit for row, fit in zip(rows, again, strict=True) if of[row] == i]
        tried += [fits[i], fitter.refit(fits[i])]
        fits[i] = max(tried, key=lambda fit: fit.log_evidence)
    return [Hypothesis(tuple(e), fit) for e, fit in zip(candidates, fits, strict=True)]


def score_tests(
    trials: Trials, base: Hypothesis, candidates: Sequence[tuple[str, ...]]
) -> np.ndarray:
    """How many standard deviations each candidate's slope stands out, at zero strength.

        z = d.r / |d|,   d = the slope of the whitened residuals r, made orthogonal to those of
                             the parameters that are there already

    Returns:
      `[candidate]`, of the last effect of each, without a refit; signed strengths by size.
    """
    count = len(trials.model_parameters)
    theta = trials.theta(base.fit.z, base.fit.free)
    scale = theta[count:]
    probes, sizes = [theta], []
    for effects in candidates:
        where, size = _strength(trials, effects[-1])
        probe = theta.copy()
        probe[where] = size
        probes.append(probe)
        sizes.append(size)
    white = np.concatenate(whitened(trials, np.stack(probes), scale), axis=1)
    residual, slopes = white[0], white[1:] - white[:1]
    used = base.fit.jacobian[:, base.fit.free[:count]]
    basis, _ = np.linalg.qr(used)
    slopes = slopes - (slopes @ basis) @ basis.T
    length = np.linalg.norm(slopes, axis=1)
    return np.abs(slopes @ residual) / np.where(length > 1e-9, length, np.inf)


def _strength(trials: Trials, effect: str) -> tuple[np.ndarray, float]:
    """Where an effect's strengths stand (one per clip, or one), and a small one."""
    names = [p.name for p in trials.model_parameters]
    where = [i for i, n in enumerate(names) if n == effect or n.startswith(f"{effect}_")]
    first = trials.model_parameters[where[0]]
    own = [i for i in where if trials.model_parameters[i].prior == first.prior]
    is_signed = float(first.prior.forward(jnp.asarray(-1.0))) < first.absent
    at = PROBE_Z if is_signed else SMALL_QUANTILE_Z
    return np.array(own if first.per_clip else own[:1]), float(first.prior.forward(jnp.asarray(at)))


def _starts(trials: Trials, base: GradientFit, free: np.ndarray, seed: int) -> np.ndarray:
    """Starts in z: new parameters over their priors, the others in one of three ways."""
    count = len(trials.model_parameters)
    generator = np.random.default_rng([seed, 41])
    new = np.flatnonzero(free & ~base.free[:count])
    size = min(STARTS_PER_PARAMETER * len(new), MOST_STARTS)
    starts = np.tile(base.z[:count], (size, 1))
    share = np.stack([generator.permutation(size) for _ in new], axis=1)
    share = (share + generator.random(share.shape)) / size
    starts[:, new] = ndtri(np.clip(share, 0.02, 0.98))
    parameters = trials.model_parameters
    zero = np.array(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
    rest = np.clip(zero, -1.0, 1.0)
    nuisance = np.array([p.role == "nuisance" for p in parameters])
    main = np.array([p.role != "nuisance" for p in parameters]) & base.free[:count]
    spread = generator.standard_normal((size, int(main.sum())))
    way = np.arange(size) % NUM_WAYS
    # Near the base fit; with the nuisances that it bent let go; and with all else let go, too.
    starts[np.ix_(way > 0, nuisance)] = rest[nuisance]
    starts[:, main] += np.where(way[:, None] == 2, SPREAD_Z, 0.1 * (way[:, None] == 1)) * spread
    return np.where(free, starts, 0.0)

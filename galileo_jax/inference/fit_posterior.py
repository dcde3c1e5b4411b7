"""From a gradient fit to a posterior, as narrow or wide as rollouts round the fit say.

The slopes at the best fit know only what is next to it. Where two events come close to each other
(bodies that nearly touch again; one that stops as the other passes) the misfit has a corner, and an
interval from slopes may be five times too narrow. So points round the fit are rolled out and
weighed by importance (`fits/importance_sampling.py`), and the posterior is drawn from these. Where
few of them have all the weight, or one is better, the fit is not yet the best, and they are near
that.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import softmax

from galileo_jax.inference.fits.gradient import SETTLED, GradientFit
from galileo_jax.inference.fits.importance_sampling import weighed
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.log_posterior import LogPosterior
from galileo_jax.inference.posterior import ESS, Posterior, Status
from galileo_jax.inference.resampled import resampled, truncated, worth
from galileo_jax.numerics.normal_matrix import symmetric_root

NUM_DRAWS = 4000
MOST_PARAMETERS = 40  # of more, as many trials have, hardly a draw weighs anything
# Draws at once, and in all until they are worth `ENOUGH` draws: a mean is then good to .02 sd.
NUM_AT_ONCE, MOST, ENOUGH = 512, 8192, 2000.0
# The same of a look round a fit; a mean is good to a sixth of its sd.
NUM_LOOKED, MOST_LOOKED, ENOUGH_LOOKED = 256, 1024, 40.0
NUM_STARTS, BETTER_NATS = 4, 0.5  # a draw beats all fits by so much where these are not the best
# Worth so few, widths are good to a tenth, and it is said; to a quarter, and slopes know as much.
FEW, TOO_FEW = 100.0, 10.0


def fit_posterior(trials: JointProblem, fit: GradientFit, seed: int) -> Posterior:
    """Draws of the posterior round a fit and the valleys beside it, sizes integrated.

    Those of the normal approximation, at the most probable sizes, where weighed draws are worth too
    few, or rollouts are slow (all engines but the rigid one in a plane).

    `fit`: the best, with the valleys beside it.
    """
    is_quick = all(problem.engine.name == "rigid" for problem in trials.problems)
    if not is_quick or fit.code not in SETTLED or fit.free.sum() > MOST_PARAMETERS:
        return laplace_posterior(trials, fit, seed)
    residuals = Residuals(trials)
    density = LogPosterior(trials, fit, residuals)
    valleys = (fit, *fit.beside)
    found = weighed(valleys, residuals, seed, density, NUM_AT_ONCE, MOST, ENOUGH)
    num_rollouts = fit.stats.get("num_rollouts", 0) + residuals.num_rollouts
    stats = {**fit.stats, "num_rollouts": num_rollouts}
    log_weights = truncated(found.log_weights)
    ess = worth(log_weights)
    if ess < TOO_FEW:
        normal = laplace_posterior(trials, fit, seed)
        return replace(normal, stats=stats, provenance={**normal.provenance, ESS: ess})
    which = resampled(log_weights, NUM_DRAWS, np.random.default_rng([seed, 31]))
    return Posterior(
        names=trials.names,
        draws=trials.theta(found.z[which], fit.free)[None],
        log_density=found.log_density[which][None],
        status=Status.CONVERGED,
        stats=stats,
        provenance={"method": "grad", "seed": seed, "code": fit.code.name, ESS: ess},
    )


def laplace_posterior(trials: JointProblem, fit: GradientFit, seed: int) -> Posterior:
    """Draws of N(mode, (J^T J + 1)^-1) in z, mapped to the parameters' units.

    Where other valleys explain the data about as well (`GradientFit.beside`) each has its share of
    the draws, by its evidence. Symmetric in z, hence inside the parameters' bounds. It knows
    nothing of skewness: compare with `--method mh` where that matters.
    """
    generator = np.random.default_rng(seed)
    count = int(fit.free.sum())
    normal = generator.standard_normal((NUM_DRAWS, count))
    z = np.tile(fit.z, (NUM_DRAWS, 1))
    ends = np.rint(NUM_DRAWS * np.cumsum(shares(fit))).astype(int)
    for one, begin, end in zip((fit, *fit.beside), [0, *ends], ends, strict=False):
        z[begin:end] = one.z
        root = symmetric_root(one.covariance[np.ix_(fit.free, fit.free)])
        z[begin:end, fit.free] += normal[begin:end] @ root
    if fit.beside:  # who takes every tenth draw takes of every valley
        order = generator.permutation(NUM_DRAWS)
        z, normal = z[order], normal[order]
    return Posterior(
        names=trials.names,
        draws=trials.theta(z, fit.free)[None],
        log_density=-0.5 * np.sum(normal**2, axis=1)[None],
        status=Status.CONVERGED if fit.code in SETTLED else Status.STEP_LIMIT,
        stats=fit.stats,
        provenance={"method": "grad", "seed": seed, "code": fit.code.name},
    )


def two_solutions(trials: JointProblem, fit: GradientFit, draws: np.ndarray) -> str | None:
    """One line where several valleys share the posterior: what differs most; else None.

    That is counted in standard deviations of the more certain of both; `draws` `[draw, parameter]`
    are the posterior's.
    """
    if not fit.beside:
        return None
    every, count = (fit, *fit.beside), len(fit.steps)
    z = np.stack([one.z[:count] for one in every])
    sds = np.stack([np.sqrt(np.diag(one.covariance)[:count]) for one in every])
    is_asked = np.array([p.role in ("main", "effect") for p in trials.model_parameters])
    wanted = is_asked & fit.free[:count]
    far = np.where(wanted, np.ptp(z, axis=0) / np.maximum(sds.min(axis=0), 1e-9), 0.0)
    i = int(np.argmax(far))
    values = [trials.theta(one.z, one.free)[i] for one in every]
    shown = [f"{value:.3g}" for value in values]
    if len(set(shown)) == 1:  # they differ in what nobody asked for
        return None
    each = zip(shown, shares(fit), strict=True)
    told = " or ".join(f"{value} ({share:.0%})" for value, share in each)
    low, high = np.quantile(draws[:, i], [0.025, 0.975])
    inside = sum(low <= value <= high for value in values)
    contains = "contain them all" if inside == len(every) else f"contain {inside} of them"
    return (
        f"{len(every)} solutions explain the clip: {trials.names[i]} {told}; "
        f"the intervals {contains}"
    )


def shares(fit: GradientFit) -> np.ndarray:
    """The probability of a fit's own valley and of each beside it, `[valley]`; they sum to 1."""
    return softmax([one.log_evidence for one in (fit, *fit.beside)])


def to_go_on_from(
    trials: JointProblem, fits: Sequence[GradientFit], residuals: Residuals, seed: int
) -> Float[np.ndarray, "start parameter"]:
    """Starts, z of the model's parameters; none where the fits describe the posterior.

    `fits`: the best of each valley, the best first; their sizes of imperfections are the trials'.
    """
    count = len(fits[0].steps)
    if fits[0].free.sum() > MOST_PARAMETERS:
        return np.empty((0, count))
    density = LogPosterior(trials, replace(fits[0], sizes=None), residuals)
    found = weighed(fits, residuals, seed, density, NUM_LOOKED, MOST_LOOKED, ENOUGH_LOOKED)
    at_fits = density(np.stack([fit.z for fit in fits])).max()
    best, heaviest = np.argmax(found.log_density), np.argsort(-found.log_weights)[:NUM_STARTS]
    if found.log_density[best] > at_fits + BETTER_NATS:
        heaviest = np.append(best, heaviest)
    elif found.ess >= ENOUGH_LOOKED:
        return np.empty((0, count))
    return found.z[heaviest, :count]


def uncertain_width(posterior: Posterior) -> str | None:
    """One line where the intervals of a fit are themselves uncertain; None where they are not."""
    ess = posterior.provenance.get(ESS)
    if ess is None or ess >= FEW:
        return None
    return (
        f"the intervals are uncertain: points round the fit are worth {ess:.0f} draws of the "
        f"posterior ({FEW:.0f} would do); --method mh draws more"
    )

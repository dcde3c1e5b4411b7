"""From a gradient fit to a posterior: draws of the normal approximation in z."""

import numpy as np
from scipy.special import softmax

from galileo_jax.inference.fits.gradient import SETTLED, GradientFit
from galileo_jax.inference.fits.normal_matrix import symmetric_root
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status

NUM_DRAWS = 4000


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
    """One line where several valleys share the posterior: what differs most; None where one has it.

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
    told = " or ".join(
        f"{value:.3g} ({share:.0%})" for value, share in zip(values, shares(fit), strict=True)
    )
    low, high = np.quantile(draws[:, i], [0.025, 0.975])
    inside = sum(low <= value <= high for value in values)
    contains = "contain them all" if inside == len(every) else f"contain {inside} of them"
    return (
        f"{len(every)} solutions explain the clip about equally well: {trials.names[i]} {told}; "
        f"the intervals {contains}"
    )


def shares(fit: GradientFit) -> np.ndarray:
    """The probability of a fit's own valley and of each beside it, `[valley]`; they sum to 1."""
    return softmax([one.log_evidence for one in (fit, *fit.beside)])

"""From a gradient fit to a posterior: draws of the normal approximation in z."""

import numpy as np

from galileo_jax.inference.fits.gradient import SETTLED, GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status

NUM_DRAWS = 4000


def laplace_posterior(trials: JointProblem, fit: GradientFit, seed: int) -> Posterior:
    """Draws of N(mode, (J^T J + 1)^-1) in z, mapped to the parameters' units.

    Symmetric in z, hence inside the parameters' bounds. It knows nothing of skewness or of a
    second mode: compare with `--method mh` where that matters.
    """
    generator = np.random.default_rng(seed)
    root = root_of(fit.covariance[np.ix_(fit.free, fit.free)])
    normal = generator.standard_normal((NUM_DRAWS, len(root)))
    z = np.tile(fit.z, (NUM_DRAWS, 1))
    z[:, fit.free] += normal @ root.T
    return Posterior(
        names=trials.names,
        draws=trials.theta(z, fit.free)[None],
        log_density=-0.5 * np.sum(normal**2, axis=1)[None],
        status=Status.CONVERGED if fit.code in SETTLED else Status.STEP_LIMIT,
        stats=fit.stats,
        provenance={"method": "grad", "seed": seed, "code": fit.code.name},
    )


def root_of(covariance: np.ndarray) -> np.ndarray:
    """R with R R^T the covariance; of one that rounding left indefinite, the nearest that is not.

    Where a hypothesis is absurd its slopes are, too, and eigenvalues span more than sixteen digits.
    """
    try:
        return np.linalg.cholesky(covariance)
    except np.linalg.LinAlgError:
        variance, vectors = np.linalg.eigh(covariance)
        return vectors * np.sqrt(np.maximum(variance, 0.0))

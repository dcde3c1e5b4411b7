"""From a gradient fit to a posterior: draws of the normal approximation in z."""

import numpy as np

from galileo_jax.inference.fits.gradient import Code, GradientFit
from galileo_jax.inference.model_error import add_model_error
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.inference.problem import Problem

NUM_DRAWS = 4000


def laplace_posterior(problem: Problem, fit: GradientFit, seed: int) -> Posterior:
    """Draws of N(mode, (J^T J + 1)^-1) in z, mapped to the parameters' units.

    Symmetric in z, hence inside the parameters' bounds. It knows nothing of skewness or of a
    second mode: compare with `--method mh` where that matters.
    """
    generator = np.random.default_rng(seed)
    root = np.linalg.cholesky(fit.covariance)
    normal = generator.standard_normal((NUM_DRAWS, len(fit.z)))
    z = fit.z + normal @ root.T
    return Posterior(
        names=problem.names,
        draws=add_model_error(problem.theta(z), problem.names, seed)[None],
        log_density=-0.5 * np.sum(normal**2, axis=1)[None],
        status=Status.CONVERGED if fit.code is Code.CONVERGED else Status.STEP_LIMIT,
        stats=fit.stats,
        provenance={"method": "grad", "seed": seed, "code": fit.code.name},
    )

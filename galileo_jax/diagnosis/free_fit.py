"""The gradient fit of one hypothesis with many smooth unknowns, from a good start."""

from typing import NamedTuple

import numpy as np

from galileo_jax.comparison.bootstrap import whitened
from galileo_jax.inference.fits.gradient import GradientFitter, Settings
from galileo_jax.inference.joint_problem import JointProblem

# What friction takes up of a constant force is a soft direction: it must be followed to its end.
SETTINGS = Settings(settled=0.005)


class FreeFit(NamedTuple):
    """A mode and the normal approximation round it.

    Attributes:
      z: `[parameter]`, noise scale last; 0 where pinned.
      free: `[parameter]`.
      covariance: `[model parameter, model parameter]`; 0 where pinned.
      jacobian: `[value, model parameter]`, of the whitened residuals; 0 where pinned.
      residual: `[value]`, whitened at the fitted noise scale.
    """

    z: np.ndarray
    free: np.ndarray
    covariance: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray


def free_fit(trials: JointProblem, start: np.ndarray, free: np.ndarray) -> FreeFit:
    """Fits one clip.

    Args:
      trials: one clip.
      start: `[parameter]`, z, noise scale last.
      free: `[parameter]`.
    """
    fitter, count = GradientFitter(trials, SETTINGS), len(start) - 1
    (fit,) = fitter.fit_from(start[None, :count], free[None, :count], np.zeros(1, int))
    # The start is of a wrong model, whose restitution may be in another valley.
    fit = fitter.refit(fit)
    theta = trials.theta(fit.z, free)
    residual = whitened(trials, theta[None], theta[count:])[0][0]
    return FreeFit(fit.z, free, fit.covariance[:count, :count], fit.jacobian, residual)

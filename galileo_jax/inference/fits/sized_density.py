"""The posterior of parameters with the sizes of imperfections integrated.

    p(z | y) = mean over x of p(z | y, x),    p(z | y, x) = p(y | z, x) p(z) / p(y | x),

x: draws of what the data leave open of the sizes, of which the linear model round the fit gives
p(y | x), too (`linear_clip`). What is measured is normal given z and x, with no linear model
between.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.fitted_clip import FittedClip
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.linear_clip import linear_clips, log_likelihood
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood, Whitening

# Of the draws of sizes: more of few measured values, whose squared number is what each costs.
LEAST_SIZES, MOST_SQUARES = 32, 500_000


def sizes_of(
    trials: JointProblem, fit: GradientFit, num: int
) -> tuple[list[dict[str, float]], Float[np.ndarray, " draw"]]:
    """Draws of the terms' sizes, x by name, and log p(y | x) of each, the largest 0."""
    assert fit.sizes is not None
    draws = fit.sizes.draws[:num, : len(fit.sizes.x)]
    linear = linear_clips(trials, fit)
    each = np.array([log_likelihood(linear, trials.terms, x) for x in draws])
    return [dict(zip(fit.sizes.names, x, strict=True)) for x in draws], each - each.max()


class SizedDensity:
    """The log density of parameters and noise scales, up to a constant."""

    def __init__(self, trials: JointProblem, fit: GradientFit, clips: Sequence[FittedClip]):
        assert fit.sizes is not None
        self._clips, self._fit = clips, fit
        num = max(LEAST_SIZES, MOST_SQUARES // fit.num_values**2)
        draws, self._of_sizes = sizes_of(trials, fit, num)
        self._data = [[clip.problem.with_sizes(x).data for x in draws] for clip in clips]

    def __call__(self, z: Float[np.ndarray, "point parameter"]) -> Float[np.ndarray, " point"]:
        """At `z`, noise scales last."""
        count = len(self._fit.steps)
        noise = np.exp(NOISE_SD * z[:, count:])
        free = np.broadcast_to(self._fit.free[:count], (len(z), count))
        found = np.zeros((len(self._of_sizes), len(z)))
        for c, (clip, each) in enumerate(zip(self._clips, self._data, strict=True)):
            predicted = clip.problem.simulate_batch(clip.theta(z[:, :count], free))
            left = _in_stated_errors(predicted, each[0])
            found += [_log_likelihood(left, noise[:, c], data) for data in each]
        found -= self._of_sizes[:, None]
        mean = np.asarray(logsumexp(found, axis=0)) - np.log(len(found))
        return np.nan_to_num(mean, nan=-np.inf) - 0.5 * np.sum(z**2, axis=1)


def _in_stated_errors(predicted_m: np.ndarray, data: Whitening) -> Float[np.ndarray, "point value"]:
    """Residuals in units of the stated errors, which no size changes."""
    with np.errstate(over="ignore", invalid="ignore"):
        left = np.einsum("oijt,pojt->poit", data.inverse_root, data.observed_m - predicted_m)
    return left.reshape(len(left), -1)


def _log_likelihood(
    left: Float[np.ndarray, "point value"], noise: Float[np.ndarray, " point"], data: Whitening
) -> Float[np.ndarray, " point"]:
    """Of what was measured, up to the constant of the tracker's own covariance."""
    with np.errstate(over="ignore", invalid="ignore"):
        along2 = (left @ data.basis.reshape(len(data.gain), -1).T) ** 2
        return GaussianLikelihood.log_density_by_modes(
            np.sum(left**2, axis=1), along2, noise, data.gain, data.num_values
        )

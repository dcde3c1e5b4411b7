"""What the Gaussian likelihood says of each measured number on its own, given all the others.

With the covariance C of `gaussian_likelihood`, P = C^-1 its precision and r = observed - predicted,

    y_i | y_-i  ~  N(y_i - (P r)_i / P_ii, 1 / P_ii)

so that leave-one-out needs neither C nor P as matrices. Errors of a track are correlated (an
offset, a wobble): the factors p(y_i) alone would count what neighbours share many times.

Source: Sundararajan and Keerthi (2001), Predictive approaches for choosing hyperparameters in
Gaussian processes, Neural Computation 13, 1103; Bürkner, Gabry and Vehtari (2021), Efficient
leave-one-out cross-validation for Bayesian non-factorized normal and Student-t models,
Computational Statistics 36, 1243.
"""

import numpy as np
from jaxtyping import Float

from galileo_jax.similarity.gaussian_likelihood import Whitening


def conditional_log_density(
    difference_m: Float[np.ndarray, "draw object axis frame"],
    noise_scale: Float[np.ndarray, " draw"],
    data: Whitening,
) -> Float[np.ndarray, "draw object axis frame"]:
    """Log p(y_i | y_-i) of every coordinate, in 1/m; -inf where masked.

    `difference_m`: observed minus predicted. `noise_scale`: on the tracker's errors.
    """
    root, basis = data.inverse_root, data.basis
    variance = np.asarray(noise_scale)[:, None] ** 2
    share = data.gain**2 / (variance + data.gain**2)  # [draw, mode]
    y = np.einsum("oijt,dojt->doit", root, difference_m)
    amplitude = np.einsum("moit,doit->dm", basis, y)
    left = y - np.einsum("moit,dm->doit", basis, share * amplitude)
    scale = variance[:, :, None, None]
    pulled = np.einsum("oijt,doit->dojt", root, left) / scale
    patterns = np.einsum("oijt,moit->mojt", root, basis) ** 2
    precision = (root**2).sum(axis=1) - np.einsum("dm,mojt->dojt", share, patterns)
    precision = precision / scale
    with np.errstate(divide="ignore", invalid="ignore"):
        density = 0.5 * (np.log(precision / (2 * np.pi)) - pulled**2 / precision)
    return np.where((root**2).sum(axis=1) > 0, density, -np.inf)


def noise_draws(
    rng: np.random.Generator, noise_scale: Float[np.ndarray, " draw"], data: Whitening
) -> Float[np.ndarray, "draw object axis frame"]:
    """Draws of the likelihood's noise, one for each of `noise_scale`, m; 0 where masked."""
    root = _root(data)
    count = len(noise_scale)
    white = rng.standard_normal((count, *data.observed_m.shape))
    amplitude = data.gain * rng.standard_normal((count, len(data.gain)))
    scale = np.asarray(noise_scale)[:, None, None, None]
    both = scale * white + np.einsum("dm,moit->doit", amplitude, data.basis)
    return np.einsum("oijt,dojt->doit", root, both)


def noise_sd_m(data: Whitening) -> Float[np.ndarray, "object axis frame"]:
    """The noise's standard deviation at noise scale 1, `[object, 2, frame]`, m; 0 where masked."""
    root = _root(data)
    modes = np.einsum("oijt,mojt->moit", root, data.basis) * data.gain[:, None, None, None]
    return np.sqrt((root**2).sum(axis=2) + (modes**2).sum(axis=0))


def _root(data: Whitening) -> np.ndarray:
    """L of the tracker's covariance L L^T, `[object, 2, 2, frame]`; 0 where nothing is measured."""
    return np.moveaxis(np.linalg.pinv(np.moveaxis(data.inverse_root, -1, 1)), 1, -1)

"""How large the tracking errors are, by the likelihood of what a model leaves over.

With C = s^2 D + U U^T, of whose modes the amplitudes are a and the gains g (see
`gaussian_likelihood.Whitening`), the log-likelihood is stationary in s where

    sum of (tracking errors at s)^2  =  degrees(s) - used + log(s) / prior_sd^2,

the squares and the count both without what the modes take up; the last part is the prior's.

Source: MacKay (1992), Bayesian interpolation, Neural Computation 4, 415 (the condition).
"""

import numpy as np
from jaxtyping import Float

from galileo_jax.similarity.gaussian_likelihood import Whitening

LOG_VARIANCES, NUM_HALVINGS = (-16.0, 16.0), 48  # where noise scales are looked for
MODE_SIZES = np.linspace(0.0, 1.0, 41)


def fitted_noise_scale(
    white: Float[np.ndarray, "point value"],
    noise_scale: Float[np.ndarray, " point"],
    used: Float[np.ndarray, " point"],
    prior_sd: float,
    data: Whitening,
) -> Float[np.ndarray, " point"]:
    """The most probable noise scales, from residuals whitened at `noise_scale`.

    `used`: how many numbers' worth of the data the parameters take up. `prior_sd`: of the scale's
    logarithm, about 0.
    """
    variance, gain2 = noise_scale[:, None] ** 2, data.gain**2
    modes = (white @ data.rows.T) ** 2
    rest = np.maximum(np.sum(white**2, axis=1) - np.sum(modes, axis=1), 0.0) * variance[:, 0]
    amplitude2 = modes * (variance + gain2)
    low, high = (np.full(len(white), end) for end in LOG_VARIANCES)
    for _ in range(NUM_HALVINGS):
        middle = (low + high) / 2
        share = 1 / (1 + gain2 * np.exp(-middle)[:, None])
        degrees = data.num_values - np.sum(1 - share, axis=1)
        total = rest + np.sum(amplitude2 * share**2, axis=1)
        asked = np.maximum(degrees - used, 1.0) + middle / (2 * prior_sd**2)
        is_larger = total * np.exp(-middle) > asked
        low, high = np.where(is_larger, middle, low), np.where(is_larger, high, middle)
    return np.exp((low + high) / 4)


def fitted_mode_size(
    white: Float[np.ndarray, " value"],
    noise_scale: float,
    data: Whitening,
    errors: Float[np.ndarray, "mode mode"] | None = None,
) -> float:
    """The most probable common size of the modes' amplitudes over their sd, from 0 to 1.

    `white`: residuals, whitened at `noise_scale`. `errors`: what of the modes' covariance is there
    in full, along them; None where nothing is.
    """
    gain2 = data.gain**2
    errors = np.zeros((len(gain2), len(gain2))) if errors is None else errors
    white = data.rows @ white
    amplitude = white * np.sqrt(noise_scale**2 + gain2)
    found = []
    for size in MODE_SIZES:
        root = np.linalg.cholesky(mode_covariance(noise_scale, size, data, errors))
        left = np.linalg.solve(root, amplitude)
        found.append(-0.5 * left @ left - np.log(np.diag(root)).sum())
    return float(MODE_SIZES[np.argmax(found)])


def mode_covariance(
    noise_scale: float, mode_size: float, data: Whitening, errors: Float[np.ndarray, "mode mode"]
) -> Float[np.ndarray, "mode mode"]:
    """Of what is seen along the modes: noise, imperfections of another size, and errors in full."""
    imperfect = np.diag(data.gain**2) - errors
    return noise_scale**2 * np.eye(len(errors)) + mode_size**2 * imperfect + errors


def errors_at(
    white: Float[np.ndarray, "point value"],
    noise_scale: Float[np.ndarray, " point"],
    other_scale: Float[np.ndarray, " point"],
    data: Whitening,
) -> Float[np.ndarray, "point value"]:
    """`Whitening.tracking_errors` at `other_scale`, from residuals whitened at `noise_scale`."""
    basis, gain2 = data.rows, data.gain**2
    before, after = noise_scale[:, None], other_scale[:, None]
    modes = white @ basis.T
    errors = modes * np.sqrt(before**2 + gain2) * after / (after**2 + gain2)
    return (white - modes @ basis) * (before / after) + errors @ basis

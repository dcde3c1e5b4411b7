"""Errors that follow each other are there in full, however small imperfections are."""

import numpy as np

from galileo_jax.similarity.gaussian_likelihood import Whitening
from galileo_jax.similarity.noise_scale import fitted_mode_size, mode_covariance

BASIS = np.eye(40)[:20].reshape(20, 1, 2, 20)
DATA = Whitening(
    np.zeros((1, 2, 20)), np.zeros((1, 2, 2, 20)), BASIS, np.full(20, 3.0), np.float64(40)
)
ERRORS = np.diag(np.where(np.arange(20) < 10, 9.0, 0.0))


def test_the_size_of_imperfections_is_not_that_of_errors():
    """Ten modes hold errors as large as stated, ten imperfections that are absent."""
    rng = np.random.default_rng(0)
    seen = rng.standard_normal(40)
    seen[:10] *= np.sqrt(10.0)
    seen[:20] /= np.sqrt(10.0)  # whitened with both in full
    with_errors = fitted_mode_size(seen, 1.0, DATA, ERRORS)
    assert with_errors < 0.2 < fitted_mode_size(seen, 1.0, DATA)
    cover = mode_covariance(1.0, with_errors, DATA, ERRORS)
    assert np.allclose(np.diag(cover)[:10], 10.0) and np.diag(cover)[10:].max() < 1.5

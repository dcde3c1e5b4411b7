"""Draws of a normal approximation, however ill its covariance is conditioned."""

import numpy as np
import pytest

from galileo_jax.inference.laplace import root_of

TURN = np.linalg.qr(np.random.default_rng(0).normal(size=(4, 4)))[0]


@pytest.mark.parametrize("least", [1e-3, 0.0, -1e-17])
def test_the_root_of_what_is_hardly_positive(least):
    covariance = (TURN * [1.0, 0.1, 1e-9, least]) @ TURN.T
    root = root_of(covariance)
    assert np.isfinite(root).all()
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-15)

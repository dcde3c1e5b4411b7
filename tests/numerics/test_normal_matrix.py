"""The inverse of 1 + J^T J, also where rounding has lost the 1."""

import numpy as np

from galileo_jax.numerics.normal_matrix import inverse, symmetric_root


def test_it_is_the_inverse():
    slopes = np.random.default_rng(3).standard_normal((4, 9, 5))
    normal = np.eye(5) + np.swapaxes(slopes, 1, 2) @ slopes
    np.testing.assert_allclose(inverse(normal) @ normal, np.tile(np.eye(5), (4, 1, 1)), atol=1e-12)


def test_slopes_so_steep_that_the_sum_is_singular():
    """Beside 1e22 a 1 is lost; what the data do not tell is known as well as by its prior."""
    slopes = np.array([[1e11, 1e11, 0.0]])
    normal = np.eye(3) + slopes.T @ slopes
    assert np.linalg.matrix_rank(normal[:2, :2]) == 1
    expected = [[0.5, -0.5, 0.0], [-0.5, 0.5, 0.0], [0.0, 0.0, 1.0]]
    np.testing.assert_allclose(inverse(normal), expected, atol=1e-6)


def test_the_root_hardly_changes_with_what_it_is_of():
    """Of equal eigenvalues the eigenvectors are any; rounding decides which."""
    generator = np.random.default_rng(4)
    turn = np.linalg.qr(generator.standard_normal((6, 6)))[0]
    covariance = (turn * [1e-6, 1e-3, 1.0, 1.0, 1.0, 2.0]) @ turn.T
    noise = 1e-14 * generator.standard_normal((6, 6))
    other = covariance + noise + noise.T
    root = symmetric_root(covariance)
    np.testing.assert_allclose(root @ root, covariance, atol=1e-14)
    np.testing.assert_allclose(symmetric_root(other), root, atol=1e-10)
    vectors = (np.linalg.eigh(each)[1] for each in (covariance, other))
    assert np.abs(np.subtract(*vectors)).max() > 1e-3, "as eigenvectors would"

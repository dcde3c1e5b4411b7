"""Covariances of linear stochastic equations, against formulas and against drawn paths."""

import numpy as np
import pytest

from galileo_jax.statespace.linear_sde import Transitions, covariance, transitions

TIMES_S = np.array([0.0, 0.03, 0.07, 0.2, 0.21, 0.9])
PLACE = np.tile([[1.0, 0.0]], (len(TIMES_S), 1, 1))


def constant(matrix):
    return np.tile(np.asarray(matrix, float), (len(TIMES_S) - 1, 1, 1))


@pytest.mark.parametrize("lasts_s", [1e-4, 0.02, 5.0])
def test_a_process_that_forgets_has_an_exponential_covariance(lasts_s):
    """Ornstein and Uhlenbeck's, also where a step is thousands of times as long as it lasts."""
    way = transitions(constant([[-1 / lasts_s]]), constant([[2 / lasts_s]]), np.diff(TIMES_S))
    found = covariance(way, np.eye(1), np.ones((len(TIMES_S), 1, 1)))[:, 0, :, 0]
    apart = np.abs(TIMES_S[:, None] - TIMES_S)
    np.testing.assert_allclose(found, np.exp(-apart / lasts_s), atol=1e-12)


def test_white_acceleration_gives_the_covariance_of_its_double_integral():
    """m^3 / 3 + |t - t'| m^2 / 2, m the earlier time."""
    way = transitions(constant([[0, 1], [0, 0]]), constant([[0, 0], [0, 1]]), np.diff(TIMES_S))
    found = covariance(way, np.zeros((2, 2)), PLACE)[:, 0, :, 0]
    earlier = np.minimum(TIMES_S[:, None], TIMES_S)
    apart = np.abs(TIMES_S[:, None] - TIMES_S)
    np.testing.assert_allclose(found, earlier**3 / 3 + apart * earlier**2 / 2, rtol=1e-9)


def test_drawn_paths_have_the_covariance():
    """Euler and Maruyama's of an acceleration that lasts 50 ms, in 4,000 paths."""
    lasts_s, num, step_s = 0.05, 4000, 1e-3
    drift, diffusion = np.zeros((2, 3, 3))
    drift[0, 1] = drift[1, 2] = 1.0
    drift[2, 2] = -1 / lasts_s
    diffusion[2, 2] = 2 / lasts_s
    way = transitions(constant(drift), constant(diffusion), np.diff(TIMES_S))
    seen = np.tile([[1.0, 0.0, 0.0]], (len(TIMES_S), 1, 1))
    expected = covariance(way, np.diag([0.0, 0.0, 1.0]), seen)[:, 0, :, 0]
    generator = np.random.default_rng(0)
    state = np.zeros((num, 3))
    state[:, 2] = generator.standard_normal(num)
    places = [state[:, 0].copy()]
    for count in np.rint(np.diff(TIMES_S) / step_s).astype(int):
        for _ in range(count):
            noise = np.sqrt(2 / lasts_s * step_s) * generator.standard_normal(num)
            state = state + step_s * state @ drift.T
            state[:, 2] += noise
        places.append(state[:, 0].copy())
    drawn = np.cov(np.array(places))
    size = np.sqrt(np.diag(expected))[1:]
    ratio = (drawn - expected)[1:, 1:] / np.outer(size, size)
    assert np.abs(ratio).max() < 4 * np.sqrt(2 / num) + 0.02  # and what a step of 1 ms is wrong by


def test_what_is_seen_of_several_states_goes_with_both():
    """A covariance of all that is seen, symmetric and of no negative variance."""
    generator = np.random.default_rng(1)
    drift = generator.normal(size=(5, 3, 3))
    root = generator.normal(size=(5, 3, 3))
    way = transitions(drift, root @ np.swapaxes(root, 1, 2), np.diff(TIMES_S))
    seen = generator.normal(size=(6, 2, 3))
    found = covariance(way, np.eye(3), seen).reshape(12, 12)
    np.testing.assert_allclose(found, found.T, rtol=1e-10)
    assert np.linalg.eigvalsh(found).min() > -1e-10 * np.linalg.eigvalsh(found).max()


def test_no_noise_and_no_drift_keep_what_was_there():
    """The start's covariance in every frame."""
    still = Transitions(constant(np.eye(2)), np.zeros((5, 2, 2)))
    found = covariance(still, np.diag([4.0, 1.0]), PLACE)[:, 0, :, 0]
    np.testing.assert_allclose(found, 4.0)

"""The noise scale is found where modelled imperfections are really there, and where not."""

import numpy as np
import pytest

from galileo_jax.similarity.conditional import noise_draws
from galileo_jax.similarity.noise_scale import errors_at, fitted_noise_scale
from tests.oracle_trials import make_trials
from tests.ramp_model import HIT

COUNT = 400
FLAT = 1e3  # of a prior's sd, so wide that it says nothing


@pytest.fixture(scope="module")
def data():
    return make_trials([HIT]).problems[0].data


def whitened(difference, data):
    return data.whiten_batch(difference, 1.0)


@pytest.mark.parametrize("scale", [0.6, 1.0, 2.5])
def test_draws_of_the_likelihood_give_their_scale_back(data, scale):
    draws = noise_draws(np.random.default_rng(71), np.full(COUNT, scale), data)
    found = fitted_noise_scale(whitened(draws, data), np.ones(COUNT), np.zeros(COUNT), FLAT, data)
    sd = 1 / np.sqrt(data.information(scale))
    assert np.mean(np.log(found / scale)) == pytest.approx(0, abs=0.3 * sd)
    assert np.std(np.log(found)) == pytest.approx(sd, rel=0.2), "as wide as Fisher says"


def test_no_other_scale_is_more_likely(data):
    draw = noise_draws(np.random.default_rng(72), np.full(1, 1.3), data)
    white = whitened(draw, data)
    (found,) = fitted_noise_scale(white, np.ones(1), np.zeros(1), FLAT, data)

    def log_likelihood(scale):
        squares = np.sum(data.whiten_batch(draw[0], scale) ** 2)
        return -0.5 * float(squares + data.log_determinant(scale))

    assert log_likelihood(found) > max(log_likelihood(0.99 * found), log_likelihood(1.01 * found))


@pytest.mark.parametrize("scale", [0.6, 2.5])
def test_errors_are_the_same_from_whichever_scale(data, scale):
    draws = noise_draws(np.random.default_rng(73), np.full(3, 1.0), data)
    direct = data.tracking_errors(draws, scale)
    found = errors_at(whitened(draws, data), np.ones(3), np.full(3, scale), data)
    np.testing.assert_allclose(found, direct, atol=1e-9)


def test_squares_of_the_errors_are_as_many_as_their_degrees(data):
    draws = noise_draws(np.random.default_rng(74), np.ones(COUNT), data)
    squares = np.sum(data.tracking_errors(draws, 1.0) ** 2, axis=1)
    expected = data.degrees(1.0)
    assert np.mean(squares) == pytest.approx(expected, abs=4 * np.std(squares) / np.sqrt(COUNT))

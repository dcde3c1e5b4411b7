"""Densities of one number given the others, against full covariances."""

import warnings

import numpy as np
import pytest

from galileo_jax.inference.convergence import arviz
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.conditional import conditional_log_density, noise_draws, noise_sd_m
from galileo_jax.similarity.gaussian_likelihood import Whitening, whitening_in
from tests.ramp_model import HIT, make_surroundings

FRAMES = 7
NUM_DRAWS = 16_000
SCENE = make_surroundings(HIT)


def make_data(frames: int = FRAMES) -> Whitening:
    """Two objects, correlated errors, one gap."""
    rng = np.random.default_rng(0)
    root = 1e-3 * (np.eye(2) + 0.4 * rng.standard_normal((2, frames, 2, 2)))
    covariance = np.moveaxis(root @ np.swapaxes(root, -1, -2), 1, -1)
    position = rng.normal(0, 0.1, (2, 2, frames))
    mask = np.ones((2, frames), bool)
    mask[1, 2] = False
    position[1, :, 2] = np.nan
    covariance[1, :, :, 2] = np.nan
    names = ("object1", "object2")
    seen = Observation(names, np.arange(frames) / 30, position, covariance, mask)
    return whitening_in(seen, SCENE)


def covariance_of(data: Whitening, noise_scale: float) -> tuple[np.ndarray, np.ndarray]:
    """The covariance `[value, value]` of what is not masked, by its definition; and which."""
    shape = data.observed_m.shape
    size = int(np.prod(shape))
    inverse = np.zeros((*shape, *shape))
    for thing in range(shape[0]):
        for frame in range(shape[2]):
            inverse[thing, :, frame, thing, :, frame] = data.inverse_root[thing, :, :, frame]
    inverse = inverse.reshape(size, size)
    chosen = np.abs(inverse).sum(axis=1) > 0
    root = np.linalg.inv(inverse[np.ix_(chosen, chosen)])
    basis = data.basis.reshape(len(data.gain), size)[:, chosen].T * data.gain
    within = noise_scale**2 * np.eye(int(chosen.sum())) + basis @ basis.T
    return root @ within @ root.T, chosen


def log_normal(r: np.ndarray, covariance: np.ndarray) -> float:
    """Of a multivariate normal about 0."""
    _, log_determinant = np.linalg.slogdet(2 * np.pi * covariance)
    return -0.5 * float(r @ np.linalg.solve(covariance, r) + log_determinant)


@pytest.mark.parametrize("noise_scale", [1.0, 0.7])
def test_each_number_given_the_others(noise_scale):
    """log p(y) - log p(y without y_i), each by brute force."""
    data = make_data()
    difference = np.random.default_rng(1).normal(0, 2e-3, (3, *data.observed_m.shape))
    scales = np.array([noise_scale, noise_scale, 1.3])
    found = conditional_log_density(difference, scales, data)
    for draw, scale in enumerate(scales):
        covariance, chosen = covariance_of(data, scale)
        r = difference[draw].reshape(-1)[chosen]
        whole = log_normal(r, covariance)
        for i in range(len(r)):
            rest = np.delete(np.arange(len(r)), i)
            others = log_normal(r[rest], covariance[np.ix_(rest, rest)])
            assert found[draw].reshape(-1)[chosen][i] == pytest.approx(whole - others, abs=1e-6)
    assert np.all(np.isneginf(found[:, 1, :, 2]))


def test_noise_has_the_covariance():
    data = make_data()
    covariance, chosen = covariance_of(data, 1.0)
    drawn = noise_draws(np.random.default_rng(2), np.ones(20_000), data)
    assert not drawn[:, 1, :, 2].any()
    drawn = drawn.reshape(len(drawn), -1)[:, chosen]
    sd = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(np.cov(drawn.T) / np.outer(sd, sd), covariance / np.outer(sd, sd),
                               atol=0.04)  # fmt: skip
    np.testing.assert_allclose(noise_sd_m(data).reshape(-1)[chosen], sd, rtol=1e-9)


def test_loo_is_that_of_a_linear_model():
    """PSIS of these densities gives what the marginal covariance gives in closed form."""
    data = make_data(12)
    rng = np.random.default_rng(3)
    covariance, chosen = covariance_of(data, 1.0)
    time = np.broadcast_to(np.linspace(-1, 1, 12), data.observed_m.shape)
    design = np.stack([time, time**2]).reshape(2, -1)[:, chosen].T
    prior_sd = np.array([0.01, 0.01])
    slopes = prior_sd * rng.standard_normal(2)
    y = design @ slopes + rng.multivariate_normal(np.zeros(len(design)), covariance)
    marginal = np.linalg.inv(covariance + (design * prior_sd**2) @ design.T)
    diagonal = np.diag(marginal)
    exact = 0.5 * np.sum(np.log(diagonal / (2 * np.pi)) - (marginal @ y) ** 2 / diagonal)
    precision = np.linalg.inv(covariance)
    spread = np.linalg.inv(design.T @ precision @ design + np.diag(prior_sd**-2))
    draws = rng.multivariate_normal(spread @ design.T @ precision @ y, spread, NUM_DRAWS)
    difference = np.zeros((NUM_DRAWS, data.observed_m.size))
    difference[:, chosen] = y - draws @ design.T
    shaped = difference.reshape(NUM_DRAWS, *data.observed_m.shape)
    density = conditional_log_density(shaped, np.ones(NUM_DRAWS), data).reshape(NUM_DRAWS, -1)[
        :, chosen
    ]
    az = arviz()
    like = az.from_dict(posterior={"b": draws[None]}, log_likelihood={"y": density[None]})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        loo = az.loo(like)
    assert loo.elpd_loo == pytest.approx(exact, abs=0.05)
    # Counting each number on its own is another thing altogether.
    sd = np.sqrt(np.diag(covariance))
    alone = -0.5 * (difference[:, chosen] / sd) ** 2 - np.log(sd * np.sqrt(2 * np.pi))
    assert abs(alone.mean(axis=0).sum() - exact) > 5

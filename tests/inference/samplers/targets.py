"""Densities whose moments are known."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.samplers.sampler import LogDensity


class Target(NamedTuple):
    log_density: LogDensity
    mean: np.ndarray
    covariance: np.ndarray


def gaussian(dim: int = 4) -> Target:
    """Correlated, with standard deviations from 0.1 to 1."""
    root = np.random.default_rng(0).normal(size=(dim, dim))
    correlated = root @ root.T / dim + 0.3 * np.eye(dim)
    scale = np.diag(np.geomspace(0.1, 1.0, dim))
    covariance = scale @ correlated @ scale
    mean = np.linspace(-1.0, 1.0, dim)
    precision = np.linalg.inv(covariance).astype(np.float32)

    def log_density(z):
        return -0.5 * (z - mean) @ precision @ (z - mean)

    return Target(log_density, mean.astype(np.float32), covariance.astype(np.float32))


def gumbel_and_logistic() -> Target:
    """Two independent skew or heavy-tailed coordinates: neither Gaussian nor symmetric."""

    def log_density(z):
        gumbel = -z[0] - jnp.exp(-z[0])
        logistic = -z[1] - 2 * jax.nn.softplus(-z[1])
        return gumbel + logistic

    mean = np.array([0.5772157, 0.0], np.float32)
    covariance = np.diag([np.pi**2 / 6, np.pi**2 / 3]).astype(np.float32)
    return Target(log_density, mean, covariance)


APART, WEIGHTS = 3.5, (0.7, 0.3)  # of two valleys: sds of the wider, shares


def two_valleys(dim: int = 4) -> Target:
    """Two normal valleys, the second half as wide; along the first coordinate they are apart."""
    centres = np.zeros((2, dim), np.float32)
    centres[1, 0] = APART
    sds, weights = np.array([1.0, 0.5]), np.array(WEIGHTS)

    def log_density(z):
        away = jnp.sum((z - centres) ** 2, axis=1) / sds**2
        return jax.nn.logsumexp(jnp.log(weights) - dim * jnp.log(sds) - 0.5 * away)

    mean = weights @ centres
    covariance = np.diag(np.full(dim, weights @ sds**2))
    covariance[0, 0] += weights[0] * weights[1] * APART**2
    return Target(log_density, mean.astype(np.float32), covariance.astype(np.float32))


def dispersed_starts(key: jax.Array, mean, covariance, num_chains: int) -> jax.Array:
    """Starting positions `[chain, dim]` ~ N(mean, 2 covariance).

    Wider than the posterior, so that R-hat can see chains that have not yet met.
    """
    mean = jnp.asarray(mean)
    cholesky = jnp.linalg.cholesky(jnp.asarray(covariance, mean.dtype))
    noise = jax.random.normal(key, (num_chains, *mean.shape), mean.dtype)
    return mean + jnp.sqrt(2.0).astype(mean.dtype) * noise @ cholesky.T

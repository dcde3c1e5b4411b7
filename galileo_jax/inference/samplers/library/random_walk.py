"""Random-walk Metropolis: BlackJAX's kernel with a learned Gaussian proposal."""

import math
from typing import ClassVar

import jax
import jax.numpy as jnp
from blackjax.mcmc import random_walk as blackjax_random_walk

from galileo_jax.inference.samplers.blackjax_kernel import metropolis_hastings
from galileo_jax.inference.samplers.registry import register
from galileo_jax.inference.samplers.sampler import (
    AbstractTunedSampler,
    Info,
    LogDensity,
    State,
    turn_of_one,
)

TARGET_ACCEPTANCE = 0.234
"""Optimal for a random walk in many dimensions (Roberts, Gelman, Gilks 1997)."""


def optimal_log_scale(dim: int) -> float:
    """log(2.38 / sqrt(dim)), the best step for a Gaussian density of known covariance."""
    return math.log(2.38 / math.sqrt(dim))


@register
class RandomWalk(AbstractTunedSampler):
    """Proposes x + s L xi with xi ~ N(0, I), L L^T the density's covariance.

    Accepts with min(1, p(y) / p(x)). In eight dimensions it takes 30 to 45 evaluations for
    one effective draw of the worst coordinate, even with a well-learned covariance.

    Source: Roberts, Gelman, Gilks, Weak convergence and optimal scaling of random walk
    Metropolis algorithms, Ann. Appl. Probab. 7 (1997), 10.1214/aoap/1034625254.
    """

    name: ClassVar[str] = "random_walk"
    cholesky: jax.Array  # [dim, dim], of the density's covariance
    log_scale: jax.Array  # []

    @classmethod
    def from_gaussian(cls, mean, covariance) -> "RandomWalk":
        """Optimal scale for `covariance`; a random walk has no use for the mean."""
        cholesky = jnp.linalg.cholesky(jnp.asarray(covariance))
        scale = jnp.asarray(optimal_log_scale(mean.shape[0]), cholesky.dtype)
        return cls(cholesky=cholesky, log_scale=scale)

    def fitted(self, mean, covariance) -> "RandomWalk":
        """New covariance, same scale."""
        cholesky = jnp.linalg.cholesky(jnp.asarray(covariance, self.cholesky.dtype))
        return type(self)(cholesky=cholesky, log_scale=self.log_scale)

    @property
    def covariance(self) -> jax.Array:
        """Of the density, without the scale of the steps."""
        return self.cholesky @ self.cholesky.T

    def rescaled(self, info: Info, gain) -> "RandomWalk":
        """Robbins-Monro towards an acceptance rate of 0.234."""
        change = gain * (jnp.mean(info.acceptance_rate) - TARGET_ACCEPTANCE)
        scale = self.log_scale + change.astype(self.log_scale.dtype)
        return type(self)(cholesky=self.cholesky, log_scale=scale)

    def turn(self, key: jax.Array, state: State, log_density: LogDensity):
        """One step."""
        return turn_of_one(*self.step(key, state, log_density))

    def step(self, key: jax.Array, state: State, log_density: LogDensity) -> tuple[State, Info]:
        """One Metropolis step."""
        # A 2-D sigma of BlackJAX's normal proposal is a Cholesky factor, not a covariance.
        noise = blackjax_random_walk.normal(jnp.exp(self.log_scale) * self.cholesky)

        def propose(key: jax.Array, position: jax.Array) -> jax.Array:
            return position + jnp.asarray(noise(key, position))

        return metropolis_hastings(key, state, log_density, propose)

"""Random-walk Metropolis: BlackJAX's kernel with a learned Gaussian proposal."""

from typing import ClassVar

import jax
import jax.numpy as jnp
from blackjax.mcmc import random_walk

from galileo_jax.inference.samplers.sampler import (
    SAMPLERS,
    LogDensity,
    State,
    TunedSampler,
    metropolis_hastings,
    turn_of_one,
)


@SAMPLERS.register
class RandomWalk(TunedSampler):
    """Proposes x + s L xi with xi ~ N(0, I), L L^T the density's covariance.

    Accepts with min(1, p(y) / p(x)).

    Source: Roberts, Gelman, Gilks, Weak convergence and optimal scaling of random walk
    Metropolis algorithms, Ann. Appl. Probab. 7 (1997), 10.1214/aoap/1034625254.
    """

    name: ClassVar[str] = "random_walk"

    def turn(self, key: jax.Array, state: State, log_density: LogDensity):
        """One step."""
        # A 2-D sigma of BlackJAX's normal proposal is a Cholesky factor, not a covariance.
        noise = random_walk.normal(jnp.exp(self.log_scale) * self.cholesky)

        def propose(key: jax.Array, position: jax.Array) -> jax.Array:
            return position + jnp.asarray(noise(key, position))

        return turn_of_one(*metropolis_hastings(key, state, log_density, propose))

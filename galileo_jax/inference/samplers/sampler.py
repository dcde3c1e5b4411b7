"""What a sampler is: a kernel with `init` and `turn`, and what the driver may tune in it.

A sampler is an immutable pytree, so that what the warm-up learns (scale, covariance) is a
traced value and never compiles anything anew. It owns no loop, no key and no output.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from blackjax.mcmc import random_walk

from galileo_jax.runtime.registry import Registry

LogDensity = Callable[[jax.Array], jax.Array]
"""`[dim] -> []`, up to a constant. -inf and NaN are never accepted."""

TARGET_ACCEPTANCE = 0.234
"""Optimal for a random walk in many dimensions (Roberts, Gelman, Gilks 1997)."""


class State(NamedTuple):
    """Where a chain is: `position` `[dim]` and the `log_density` `[]` there."""

    position: jax.Array
    log_density: jax.Array


class Info(NamedTuple):
    """What one step did: the probability `[]` to accept the proposal, and whether it was."""

    acceptance_rate: jax.Array
    is_accepted: jax.Array


class AbstractSampler(eqx.Module):
    """A Markov kernel as two pure functions; each step costs exactly one log density.

    Steps come in turns, whose log densities are evaluated together: a batch of rollouts costs
    little more than one. A sampler may carry more in its state and info than `State` and `Info`
    do, but not less.
    """

    name: ClassVar[str]
    steps_per_turn: ClassVar[int] = 1

    def init(self, position: jax.Array, log_density: LogDensity) -> Any:
        """The state at `position` `[dim]`; one evaluation."""
        return State(position, log_density(position))

    @abstractmethod
    def turn(
        self, key: jax.Array, state: Any, log_density: LogDensity
    ) -> tuple[Any, tuple[Any, Any]]:
        """`steps_per_turn` steps of one chain: the last state; states and infos `[step, ...]`."""


class TunedSampler(AbstractSampler):
    """A sampler whose proposals have a Gaussian shape that a warm-up can learn.

    The first step of a turn is a random walk's. Its scale goes to 2.38 / sqrt(dim), the best for a
    Gaussian density of known covariance, and by Robbins-Monro to where it accepts 0.234.
    """

    mean: jax.Array  # [dim]
    cholesky: jax.Array  # [dim, dim], of the density's covariance
    log_scale: jax.Array  # [], of the random walk

    @classmethod
    def from_gaussian(cls, mean: jax.Array, covariance: jax.Array) -> Self:
        """The sampler for a density near N(mean, covariance): a Laplace fit, or a guess."""
        mean = jnp.asarray(mean)
        scale = jnp.asarray(math.log(2.38 / math.sqrt(mean.shape[0])), mean.dtype)
        return cls(mean, _cholesky(covariance, mean), scale)

    def fitted(self, mean: jax.Array, covariance: jax.Array) -> Self:
        """The same sampler with a new mean and covariance; its learned scale is kept."""
        mean = jnp.asarray(mean, self.mean.dtype)
        return type(self)(mean, _cholesky(covariance, mean), self.log_scale)

    @property
    def covariance(self) -> jax.Array:
        """The density's covariance `[dim, dim]` as believed now."""
        return self.cholesky @ self.cholesky.T

    def rescaled(self, info: Any, gain: jax.Array) -> Self:
        """One Robbins-Monro step of the scale: log s += gain (acceptance - target).

        `info`: of a turn of all chains, `[chain, step]`. A gain of 0 leaves the sampler as it is.
        """
        change = gain * (jnp.mean(info.acceptance_rate[:, 0]) - TARGET_ACCEPTANCE)
        scale = self.log_scale + change.astype(self.log_scale.dtype)
        return type(self)(self.mean, self.cholesky, scale)


def _cholesky(covariance: jax.Array, mean: jax.Array) -> jax.Array:
    return jnp.linalg.cholesky(jnp.asarray(covariance, mean.dtype))


def metropolis_hastings(
    key: jax.Array,
    state: State,
    log_density: LogDensity,
    propose: Callable[[jax.Array, jax.Array], jax.Array],
    proposal_log_density: Callable[[jax.Array, jax.Array], jax.Array] | None = None,
) -> tuple[State, Info]:
    """One step: y ~ q(. | x), kept with min(1, p(y) q(x | y) / (p(x) q(y | x))), by BlackJAX.

    `log_density`: log p; called once, with y. A y of NaN density is never kept. `propose`: draws y,
    `(key, x)`. `proposal_log_density`: log q(y | x) of `(x, y)`; None where q is symmetric.
    """

    # What is easy to get wrong (1.7.1): log q(to | from), and swapped arguments fail silently.
    def log_q(from_state, to_state):
        assert proposal_log_density is not None
        return proposal_log_density(from_state.position, to_state.position)

    # BlackJAX's annotations say float and pytree where arrays are meant.
    kernel: Any = random_walk.build_rmh()
    current: Any = random_walk.RWState(*state)  # pyright: ignore[reportArgumentType]
    asymmetric = None if proposal_log_density is None else log_q
    moved, info = kernel(key, current, log_density, propose, asymmetric)
    return State(moved.position, moved.logdensity), Info(info.acceptance_rate, info.is_accepted)


def turn_of_one(state: Any, info: Any) -> tuple[Any, tuple[Any, Any]]:
    """What a step gave, as a turn."""
    return state, jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], (state, info))


SAMPLERS: Registry[type[TunedSampler]] = Registry(
    "sampler", "samplers", "galileo_jax.inference.samplers.library"
)

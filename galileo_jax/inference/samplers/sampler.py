"""What a sampler is: a kernel with `init` and `turn`, and what the driver may tune in it.

A sampler is an immutable pytree, so that what the warm-up learns (scale, covariance) is a
traced value and never compiles anything anew. It owns no loop, no key and no output.
"""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp

LogDensity = Callable[[jax.Array], jax.Array]
"""`[dim] -> []`, up to a constant. -inf and NaN are never accepted."""


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


class AbstractTunedSampler(AbstractSampler):
    """A sampler whose proposals have a Gaussian shape that a warm-up can learn."""

    @classmethod
    @abstractmethod
    def from_gaussian(cls, mean: jax.Array, covariance: jax.Array) -> "AbstractTunedSampler":
        """The sampler for a density near N(mean, covariance): a Laplace fit, or a guess."""

    @abstractmethod
    def fitted(self, mean: jax.Array, covariance: jax.Array) -> "AbstractTunedSampler":
        """The same sampler with a new mean and covariance; its learned scale is kept."""

    @property
    @abstractmethod
    def covariance(self) -> jax.Array:
        """The density's covariance `[dim, dim]` as believed now."""

    @abstractmethod
    def rescaled(self, info: Any, gain: jax.Array) -> "AbstractTunedSampler":
        """One Robbins-Monro step of the scale: log s += gain (acceptance - target).

        Arguments:
          info: of a turn of all chains, `[chain, step]`.
          gain: 0 leaves the sampler exactly as it is.
        """


def turn_of_one(state: Any, info: Any) -> tuple[Any, tuple[Any, Any]]:
    """What a step gave, as a turn."""
    return state, jax.tree.map(lambda leaf: jnp.asarray(leaf)[None], (state, info))

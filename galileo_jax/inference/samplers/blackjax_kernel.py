"""BlackJAX's Metropolis-Hastings kernel behind our State and Info, in one place.

What is easy to get wrong there (1.7.1): `proposal_logdensity_fn(from_state, to_state)` is
log q(to | from), and swapped arguments fail silently.
"""

from collections.abc import Callable
from typing import Any

import jax
from blackjax.mcmc import random_walk

from galileo_jax.inference.samplers.sampler import Info, LogDensity, State

Propose = Callable[[jax.Array, jax.Array], jax.Array]
"""`(key, position [dim]) -> [dim]`."""

ProposalLogDensity = Callable[[jax.Array, jax.Array], jax.Array]
"""`(x, y) -> log q(y | x)`: of proposing y when at x."""


def metropolis_hastings(
    key: jax.Array,
    state: State,
    log_density: LogDensity,
    propose: Propose,
    proposal_log_density: ProposalLogDensity | None = None,
) -> tuple[State, Info]:
    """One step: y ~ q(. | x), kept with min(1, p(y) q(x | y) / (p(x) q(y | x))).

    Arguments:
      key: for the proposal and its acceptance.
      state: x and log p(x).
      log_density: log p; called once, with y. A y of NaN density is never kept.
      propose: draws y.
      proposal_log_density: log q; None where q is symmetric.
    """

    def blackjax_log_q(from_state, to_state):
        assert proposal_log_density is not None
        return proposal_log_density(from_state.position, to_state.position)

    # BlackJAX's annotations say float and pytree where arrays are meant.
    log_q = None if proposal_log_density is None else blackjax_log_q
    kernel: Any = random_walk.build_rmh()
    current: Any = random_walk.RWState(*state)  # pyright: ignore[reportArgumentType]
    moved, info = kernel(key, current, log_density, propose, log_q)
    return State(moved.position, moved.logdensity), Info(info.acceptance_rate, info.is_accepted)

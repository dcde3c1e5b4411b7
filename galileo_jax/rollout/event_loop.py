"""From event to event within one recorded step: what both halves of the rigid engine do."""

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

Bodies = TypeVar("Bodies")  # a PyTree


def step_by_events(
    advance: Callable[[Bodies, jax.Array, jax.Array, jax.Array], tuple[Bodies, jax.Array]],
    bodies: Bodies,
    time_s: jax.Array,
    dt_s: float,
    most: int,
) -> Bodies:
    """One recorded step.

    Args:
      advance: `(bodies, time_s, left_s, is_last)` to the bodies at the next event, or after
        `left_s`, and the time that took; the latter in any case where `is_last`.
      bodies: at the beginning.
      time_s: of the beginning.
      dt_s: the step.
      most: events in it.
    """

    def is_left(carry: tuple[Bodies, jax.Array, Any]) -> jax.Array:
        _, left, count = carry
        return (left > 0) & (count < most)

    def phase(carry: tuple[Bodies, jax.Array, Any]):
        bodies, left, count = carry
        bodies, spent = advance(bodies, time_s + dt_s - left, left, count == most - 1)
        return bodies, left - spent, count + 1

    return jax.lax.while_loop(is_left, phase, (bodies, jnp.asarray(dt_s), 0))[0]

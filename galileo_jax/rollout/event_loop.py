"""From record to record, and from event to event between them: what both rigid engines do."""

import functools
from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp

Bodies = TypeVar("Bodies")  # a PyTree

PART = 16  # records are made in parts of so many, as many parts as are asked for


def recorded(
    step: Callable[[Bodies, jax.Array], Bodies],
    bodies: Bodies,
    num_records: int,
    count: jax.Array | None = None,
) -> Bodies:
    """The bodies at every record: leaves `[record, ...]`.

    Args:
      step: bodies at a record and its index to those at the next.
      bodies: at the first.
      num_records: which is compiled for.
      count: of records that are wanted; beyond, bodies stay where they are then. None: all.
    """

    def part(bodies: Bodies, first: jax.Array) -> tuple[Bodies, Bodies]:
        def record(bodies: Bodies, index: jax.Array) -> tuple[Bodies, Bodies]:
            return step(bodies, index), bodies

        return jax.lax.scan(record, bodies, first + jnp.arange(PART))

    return recorded_in_parts(part, bodies, num_records, count)


def recorded_in_parts(
    part: Callable[[Bodies, jax.Array], tuple[Bodies, Bodies]],
    bodies: Bodies,
    num_records: int,
    count: jax.Array | None = None,
) -> Bodies:
    """As `recorded`, of bodies that are moved on by `PART` records at once.

    Args:
      part: bodies at a record and its index to those after the part, and to those at its records,
        leaves `[record, ...]`.
      bodies: at the first.
      num_records: as of `recorded`.
      count: as of `recorded`.
    """
    num_parts = -(-num_records // PART)
    if count is None:
        firsts = PART * jnp.arange(num_parts)
        made = jax.lax.scan(part, bodies, firsts)[1]
        return jax.tree.map(lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:num_records], made)

    def one(i: jax.Array, carry: tuple[Bodies, Bodies]) -> tuple[Bodies, Bodies]:
        bodies, made = carry
        bodies, own = part(bodies, i * PART)
        put = functools.partial(jax.lax.dynamic_update_slice_in_dim, start_index=i * PART, axis=0)
        return bodies, jax.tree.map(put, made, own)

    padded = num_parts * PART
    empty = jax.tree.map(lambda leaf: jnp.zeros((padded, *leaf.shape), leaf.dtype), bodies)
    made = jax.lax.fori_loop(0, -(-count // PART), one, (bodies, empty))[1]
    is_over = jnp.arange(padded) >= count

    def held(leaf: jax.Array) -> jax.Array:
        over = is_over.reshape(-1, *[1] * (leaf.ndim - 1))
        return jnp.where(over, leaf[count - 1], leaf)[:num_records]

    return jax.tree.map(held, made)


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

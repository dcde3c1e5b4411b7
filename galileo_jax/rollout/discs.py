"""Discs on a level table, and what does not change while they move."""

import math
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.model.effects.effect import Rims, Walls
from galileo_jax.rollout.motion import Dynamics
from galileo_jax.rollout.oval_rims import Rim

ROOT2 = math.sqrt(2.0)


class Discs(NamedTuple):
    """All discs of one rollout, or their rates of change.

    Attributes:
      place_m, speed_m_s: `[object, 3]`, x, y and r turning / sqrt(2).
      way_m: `[object]`, how far each has come along its curve.
    """

    place_m: Float[jax.Array, "object 3"]
    speed_m_s: Float[jax.Array, "object 3"]
    way_m: Float[jax.Array, " object"]

    def after(self, a: jax.Array, t: jax.Array) -> "Discs":
        """At a constant acceleration `[object, 3]`."""
        along = length(self.speed_m_s[:, :2])
        return Discs(
            self.place_m + self.speed_m_s * t + 0.5 * a * t**2,
            self.speed_m_s + a * t,
            self.way_m + along * t,
        )


class Table(NamedTuple):
    """What does not change in a rollout.

    Attributes:
      law: the equations of motion.
      rims: what a hit does.
      radius_m: `[object]`, true.
      walls: true; None where there are none.
      pressure: `[object, 2]`, where discs press on the table, see `Effect.pressure`; None: in the
        middle.
      oval: `[object, 2]`, how far from round rims are, see `Effect.oval`; None: all are round.
    """

    law: Dynamics
    rims: Rims
    radius_m: jax.Array
    walls: Walls | None
    pressure: Any | None
    oval: Any | None

    def rim(self, discs: Discs) -> Rim | None:
        """The rims as they are turned; None where all are round."""
        if self.oval is None:
            return None
        return Rim(self.radius_m, self.oval, ROOT2 * discs.place_m[:, 2] / self.radius_m)


def length(vectors: jax.Array) -> jax.Array:
    """Over the last axis, with a finite derivative at 0."""
    square = jnp.sum(vectors**2, axis=-1)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)

"""What the engines written in JAX share: batches, lengths, and compiled programs."""

import functools
from collections.abc import Callable
from typing import Any, ClassVar

import jax
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.devices import over_devices
from galileo_jax.runtime.batching import MOTIONS, in_chunks, rounded_up
from galileo_jax.runtime.trace_cache import trace_cached

RECORDS = 128  # rollouts' lengths are rounded up to multiples, so that clips share programs

Motion = tuple[
    Float[jax.Array, "*batch object 2 record"], Float[jax.Array, "*batch object 2 record"]
]


class EngineJax:
    """Simulates batches of parameter vectors; compiled once for all clips of a kind.

    Attributes:
      roll_out: `(effects, names, num_records, dt_s, theta, scene)`, theta `[parameter]`, to
        centres and velocities, each `[object, 2, record]`.
    """

    name = "rigid"
    roll_out: ClassVar[Callable[..., Motion]]

    def __init__(self, model: Model):
        self.model = model

    def simulate(
        self, theta: Float[np.ndarray, "batch parameter"]
    ) -> tuple[np.ndarray, np.ndarray]:
        """As `EngineC.simulate`: centres and velocities `[batch, object, 2, record + 1]`."""
        motion = in_chunks(MOTIONS, self._rolled_up, np.asarray(theta))
        count = self.model.num_records + 1
        return motion[0][..., :count], motion[1][..., :count]

    def traceable(self, theta: Float[jax.Array, "batch parameter"]) -> Motion:
        """`simulate` in JAX: can be jitted, vmapped and differentiated."""
        position, velocity = self._rolled_up(theta)
        count = self.model.num_records + 1
        return position[..., :count], velocity[..., :count]

    def _rolled_up(self, theta: Any) -> Motion:
        """As many records as programs are compiled for."""
        model = self.model
        return _roll_out_batch(
            self.roll_out,
            model.effects + model.nuisances,
            model.names,
            rounded_up(model.num_records + 1, RECORDS),
            model.record_dt_s,
            theta,
            model.scene.surroundings,
        )


@trace_cached(num_static=5)
def _roll_out_batch(
    roll_out: Callable[..., Motion],
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
) -> Motion:
    one = functools.partial(roll_out, effects, names, num_records, dt_s)
    return over_devices(jax.vmap(one, (0, None)), theta.shape[0])(theta, scene)

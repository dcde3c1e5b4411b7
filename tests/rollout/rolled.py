"""One rollout as a function of `z`."""

import jax
import jax.numpy as jnp

from galileo_jax.model.parameters import forward
from galileo_jax.rollout.rollout import Engine, in_jax
from galileo_jax.rollout.trajectory import Trajectory


def rolled(engine: Engine, z: jax.Array) -> Trajectory:
    """The motion at `z` `[parameter]`; no pitch of its own."""
    position, velocity = in_jax(engine)(forward(engine.model.parameters, z[None]))
    times = jnp.arange(position.shape[-1]) * engine.model.record_dt_s
    return Trajectory(times, position[0], velocity[0], position[0][:, 0])

"""One rollout as a function of `z`, and its derivative."""

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.model.parameters import PriorTable
from galileo_jax.rollout.rollout import Engine, Trajectory, at_times, in_jax


def rolled(engine: Engine, z: jax.Array | np.ndarray) -> Trajectory:
    """The motion at `z` `[parameter]`; no pitch of its own."""
    position, velocity = in_jax(engine)(
        PriorTable.of(engine.model.parameters).forward(jnp.asarray(z)[None])
    )
    times = jnp.arange(position.shape[-1]) * engine.model.record_dt_s
    return Trajectory(times, position[0], velocity[0])


def derivatives(engine: Engine, z: jax.Array | np.ndarray, times_s: jax.Array, step: float):
    """JAX's `[object, 2, frame, parameter]` of the centres, and central differences `[parameter,
    object, 2, frame]`."""

    def centres(z):
        return at_times(rolled(engine, z), times_s)[0]

    slopes = np.asarray(jax.jit(jax.jacfwd(centres))(z))
    many = jax.jit(jax.vmap(centres))
    offsets = step * np.eye(len(z))
    return slopes, np.asarray(many(z + offsets) - many(z - offsets)) / (2 * step)

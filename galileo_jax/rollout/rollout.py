"""What an engine is, an engine as a function of JAX, and where its objects are at any time.

The rigid engine is JAX throughout and has JAX's derivatives. MuJoCo's are called back, and have
none: stiff contacts make the exact derivative meaningless (docs/explanation/contact.md). The fit
takes differences of whole batches at the posterior's scale, with every engine.
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.model import Model
from galileo_jax.rollout.events import cubic

JUMP_M_S2 = 30.0  # no steady force accelerates so much

Places = Float[np.ndarray, "batch object axis record"]
Motion = tuple[Places, Places]
"""Centres (m) and velocities (m/s), from the release on, every `Model.record_dt_s`."""


class Trajectory(NamedTuple):
    """Simulated motion of all objects' centres on the engine's own time grid.

    Leading batch axes are allowed before the axes named here.
    """

    times_s: jax.Array  # `[step]`, s since the release, evenly spaced
    position_m: jax.Array  # `[object, 2, step]`, m; x along the travel, y up, origin at the foot
    velocity_m_s: jax.Array  # `[object, 2, step]`, m/s


@runtime_checkable
class Engine(Protocol):
    """Something that rolls out a batch of parameter vectors."""

    name: str
    model: Model

    def simulate(self, theta: Float[np.ndarray, "batch parameter"]) -> "Motion":
        """Parameters, in their units, to centres (m) and velocities (m/s)."""
        ...


def in_jax(engine: Engine) -> Callable[[jax.Array], tuple[jax.Array, jax.Array]]:
    """The engine as a JAX function of parameters `[batch, parameter]`, in their units.

    It can be jitted and vmapped (one call of the engine for the whole batch); only the rigid
    engine's can be differentiated.
    """
    if hasattr(engine, "traceable"):
        return engine.traceable  # pyright: ignore
    model = engine.model
    shape = (len(model.scene.names), 2, model.num_records + 1)

    def host(theta: np.ndarray | jax.Array) -> tuple[np.ndarray, np.ndarray]:
        theta = np.asarray(theta)
        # XLA calls back on a thread of its own, which does not have the caller's setting.
        with jax.enable_x64(theta.dtype == np.float64):
            position, velocity = engine.simulate(theta.reshape(-1, theta.shape[-1]))
        lead = theta.shape[:-1]
        return position.reshape(*lead, *shape), velocity.reshape(*lead, *shape)

    def call(theta: jax.Array) -> tuple[jax.Array, jax.Array]:
        result = jax.ShapeDtypeStruct((theta.shape[0], *shape), theta.dtype)
        return jax.pure_callback(host, (result, result), theta, vmap_method="broadcast_all")

    return call


def at_times(trajectory: Trajectory, times_s: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Centres and velocities `[object, 2, frame]`, by Hermite's cubics between events.

    Before the release the objects stand at their start, after the end they keep their last place.
    """
    dt = trajectory.times_s[1]
    last = trajectory.times_s.shape[0] - 2
    u = jnp.clip(times_s / dt, 0.0, last + 1.0)
    i = jnp.clip(jnp.floor(u).astype(int), 0, last)
    s = u - i
    x0, x1 = trajectory.position_m[..., i], trajectory.position_m[..., i + 1]
    v0, v1 = trajectory.velocity_m_s[..., i] * dt, trajectory.velocity_m_s[..., i + 1] * dt
    position, velocity = cubic(x0, x1, v0, v1, s)
    velocity = velocity / dt
    # A jump of the velocity (a hit, the foot): straight on both sides of where they meet.
    jump = v1 - v0
    is_jump = jnp.abs(jump) > JUMP_M_S2 * dt**2
    meet = jnp.clip((x0 - x1 + v1) / jnp.where(is_jump, jump, 1.0), 0.0, 1.0)
    before = s < meet
    position = jnp.where(is_jump, jnp.where(before, x0 + v0 * s, x1 - v1 * (1 - s)), position)
    velocity = jnp.where(is_jump, jnp.where(before, v0, v1) / dt, velocity)
    inside = (times_s > 0) & (times_s < trajectory.times_s[-1])
    return position, jnp.where(inside, velocity, 0.0)

"""What a toss's model leaves over: places and turnings, frame by frame, in JAX.

Parameters that all tosses share are searched without bounds (`COMMON`); each toss has besides the
twelve numbers of its start, as changes of what its flight told: place (m), turning (rad),
velocity (m/s), spin (rad/s).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.rollout.body import Pose, box, thrown
from galileo_jax.rollout.engine_body import roll_out

# Inertia: principal moment over mass times edge squared; 1/6 of a solid cube, 5/18 of a thin shell.
COMMON = ("friction", "restitution", "edge", "floor", "gravity", "rounding", "inertia")
UNITS = {"edge": "m", "floor": "m", "gravity": "m/s^2", "rounding": "m"}
RESTITUTION, FLOOR, EDGE = (COMMON.index(name) for name in ("restitution", "floor", "edge"))
SUBSTEPS = 2  # from frame to frame; what that leaves out is far below the model's own errors


class Start(NamedTuple):
    """The first guess of a toss's start: `[3]`, `[4]`, `[3]`, `[3]`."""

    position_m: jax.Array
    quaternion: jax.Array
    velocity_m_s: jax.Array
    spin_rad_s: jax.Array


class Seen(NamedTuple):
    """One toss: from frame to frame `[frame]`, s; places `[frame + 1, 3]`, quaternions."""

    steps_s: jax.Array
    position_m: jax.Array
    quaternion: jax.Array


def forward(z: Float[jax.Array, " common"]) -> Float[jax.Array, " common"]:
    """From unbounded numbers to the parameters, in their units.

    In place of the floor the search has the height of the centre when the cube rests on a face,
    floor + edge / 2: impacts hardly tell floor and edge apart, and that height is seen.
    """
    positive = jnp.exp(z)
    share = jax.nn.sigmoid(z[RESTITUTION])
    return positive.at[RESTITUTION].set(share).at[FLOOR].set(z[FLOOR] - positive[EDGE] / 2)


def backward(value: Float[jax.Array, " common"]) -> Float[jax.Array, " common"]:
    """The inverse."""
    share = value[RESTITUTION]
    logs = jnp.log(value.at[FLOOR].set(1.0))
    resting = value[FLOOR] + value[EDGE] / 2
    return logs.at[RESTITUTION].set(jnp.log(share / (1 - share))).at[FLOOR].set(resting)


def motion(z: jax.Array, change: jax.Array, start: Start, steps_s: jax.Array) -> Pose:
    """The poses at all frames of one toss."""
    friction, restitution, edge, floor, gravity, rounding, inertia = forward(z)
    solid = box(edge * jnp.ones(3), friction, restitution, gravity, floor, rounding)
    solid = solid._replace(inertia_m2=inertia * edge**2 * jnp.ones(3))
    pose = thrown(
        solid,
        start.position_m + change[:3],
        times(small(change[3:6]), start.quaternion),
        start.velocity_m_s + change[6:9],
        start.spin_rad_s + change[9:12],
    )
    return roll_out(solid, pose, steps_s, SUBSTEPS)


def left_over(
    z: jax.Array, change: jax.Array, start: Start, seen: Seen
) -> Float[jax.Array, "frame 6"]:
    """Observed minus predicted: places, m, and turnings, rad (about the world's axes)."""
    poses = motion(z, change, start, seen.steps_s)
    turned = jax.vmap(between)(poses.quaternion, seen.quaternion)
    return jnp.concatenate([seen.position_m - poses.position_m, turned], axis=1)


def times(one: jax.Array, other: jax.Array) -> Float[jax.Array, " 4"]:
    """The product of two quaternions: first `other`, then `one`."""
    w, v, s, u = one[0], one[1:], other[0], other[1:]
    return jnp.concatenate([(w * s - v @ u)[None], w * u + s * v + jnp.cross(v, u)])


def small(turn: jax.Array) -> Float[jax.Array, " 4"]:
    """The quaternion of a turning `[3]`, rad, exact for small ones."""
    found = jnp.concatenate([jnp.ones(1), 0.5 * turn])
    return found / jnp.linalg.norm(found)


def between(one: jax.Array, other: jax.Array) -> Float[jax.Array, " 3"]:
    """The turning that leads from one quaternion to the other, rad."""
    back = one * jnp.array([1.0, -1.0, -1.0, -1.0])
    w, *v = times(other, back)
    vector = jnp.stack(v) * jnp.where(w < 0, -1.0, 1.0)
    size = jnp.sqrt(vector @ vector + 1e-24)
    return 2 * jnp.arctan2(size, jnp.abs(w)) / size * vector

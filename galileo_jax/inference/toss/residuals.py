"""What a toss's model leaves over: places and turnings, frame by frame, in JAX.

Parameters that all tosses share are searched without bounds (`COMMON`); each toss has besides the
twelve numbers of its start, as changes of what its flight told: place (m), turning (rad),
velocity (m/s), spin (rad/s).
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.rollout.body import Pose, box, rotation, thrown
from galileo_jax.rollout.engine_body import roll_out

# Inertia: principal moment over mass times edge squared; 1/6 of a solid cube, 5/18 of a thin shell.
# Centre: of mass, from the middle of the cube (which is what poses follow), along its own axes.
CENTRE = ("centre_x", "centre_y", "centre_z")
COMMON = ("friction", "restitution", "edge", "floor", "gravity", "rounding", "inertia", *CENTRE)
UNITS = {"edge": "m", "floor": "m", "gravity": "m/s^2", "rounding": "m"} | dict.fromkeys(
    CENTRE, "m"
)
RESTITUTION, FLOOR, EDGE = (COMMON.index(name) for name in ("restitution", "floor", "edge"))
OFF = COMMON.index(CENTRE[0])  # from here on signed lengths
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

    In place of the edge the search has the height of the middle when the cube rests on a face,
    floor + edge / 2. That is seen; corners tell only edge - 2 rounding, so that edge, rounding and
    floor would go together along a line.
    """
    share = jax.nn.sigmoid(z[RESTITUTION])
    edge = 2 * (jnp.exp(z[EDGE]) - z[FLOOR])
    values = jnp.exp(z).at[RESTITUTION].set(share).at[FLOOR].set(z[FLOOR]).at[EDGE].set(edge)
    return values.at[OFF:].set(z[OFF:])


def backward(value: Float[jax.Array, " common"]) -> Float[jax.Array, " common"]:
    """The inverse."""
    share, floor = value[RESTITUTION], value[FLOOR]
    resting = floor + value[EDGE] / 2
    logs = jnp.log(value.at[FLOOR].set(1.0).at[OFF:].set(1.0).at[EDGE].set(resting))
    odds = jnp.log(share / (1 - share))
    return logs.at[RESTITUTION].set(odds).at[FLOOR].set(floor).at[OFF:].set(value[OFF:])


def motion(z: jax.Array, change: jax.Array, start: Start, steps_s: jax.Array) -> Pose:
    """The poses at all frames of one toss; places are those of the middle of the cube."""
    value = forward(z)
    friction, restitution, edge, floor, gravity, rounding, inertia = value[:OFF]
    centre = value[OFF:]
    solid = box(edge * jnp.ones(3), friction, restitution, gravity, floor, rounding)
    solid = solid._replace(
        corners_m=solid.corners_m - centre, inertia_m2=inertia * edge**2 * jnp.ones(3)
    )
    quaternion = times(small(change[3:6]), start.quaternion)
    spin = start.spin_rad_s + change[9:12]
    lever = rotation(quaternion) @ centre
    pose = thrown(
        solid,
        start.position_m + change[:3] + lever,
        quaternion,
        start.velocity_m_s + change[6:9] + jnp.cross(spin, lever),
        spin,
    )
    poses = roll_out(solid, pose, steps_s, SUBSTEPS)
    middle = poses.position_m - jax.vmap(rotation)(poses.quaternion) @ centre
    return poses._replace(position_m=middle)


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

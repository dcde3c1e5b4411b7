"""A rigid body in space: its shape, where it is and how it is turned, and how it flies.

Axes: x and y level, z up. Quaternions have the real part first and turn the body's axes into
the world's. Momenta are per mass: the spin is carried as angular momentum, which nothing changes in
flight, so that it is kept exactly; a half of a step turns the body by a Runge-Kutta step.

A step is half of the way as before, the impulses of the contacts that last, and half of the way as
after: exact in flight up to the turning's Runge-Kutta step, of second order in contact. An impact
changes speeds only.

Source: Moreau (1988), see `box_impulses`; Moreau (1999), Numerical aspects of the sweeping
process, Comput. Methods Appl. Mech. Eng. 177, 329.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.rollout.box_impulses import Corners, Points, Speeds, after_impulses
from galileo_jax.rollout.events import runge_kutta


class Solid(NamedTuple):
    """A convex body, and the plane that it falls on."""

    corners_m: Float[jax.Array, "corner 3"]  # about the centre of mass, along the principal axes
    inertia_m2: Float[jax.Array, " 3"]  # principal moments of inertia over the mass
    friction: Float[jax.Array, ""]  # between corners and plane, of slipping and of impacts
    # Share of the speed against the plane with which a corner leaves it
    restitution: Float[jax.Array, ""]
    gravity: Float[jax.Array, ""]  # m/s^2
    floor_m: Float[jax.Array, ""]  # how high the plane is
    # Radius of the balls that corners end in, and edges and faces with them; their centres are
    # `corners_m`
    round_m: Float[jax.Array, ""]


class Pose(NamedTuple):
    """A body at one instant."""

    position_m: Float[jax.Array, " 3"]  # its centre of mass
    quaternion: Float[jax.Array, " 4"]
    velocity_m_s: Float[jax.Array, " 3"]
    momentum_m2_s: Float[jax.Array, " 3"]  # angular momentum over the mass, along the world's axes


def box(
    size_m: Float[jax.Array, " 3"],
    friction: jax.Array,
    restitution: jax.Array,
    gravity: jax.Array,
    floor_m: jax.Array,
    round_m: jax.Array | float = 0.0,
) -> Solid:
    """An even box of edges `[3]`, rounded within `round_m`; its inertia is that of a sharp one."""
    size_m = jnp.asarray(size_m)
    signs = jnp.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    square = size_m**2
    inertia = (jnp.sum(square) - square) / 12
    numbers = (friction, restitution, gravity, floor_m, round_m)
    return Solid(
        signs * (size_m - 2 * round_m), inertia, *(jnp.asarray(number, float) for number in numbers)
    )


def thrown(
    solid: Solid,
    position_m: jax.Array,
    quaternion: jax.Array,
    velocity_m_s: jax.Array,
    spin_rad_s: jax.Array,
) -> Pose:
    """A pose from a spin `[3]` along the world's axes, rad/s."""
    place, quaternion, velocity, spin = (
        jnp.asarray(values, float) for values in (position_m, quaternion, velocity_m_s, spin_rad_s)
    )
    quaternion = quaternion / jnp.linalg.norm(quaternion)
    turned = rotation(quaternion)
    momentum = turned @ (solid.inertia_m2 * (turned.T @ spin))
    return Pose(place, quaternion, velocity, momentum)


def rotation(quaternion: jax.Array) -> Float[jax.Array, "3 3"]:
    """The matrix that turns the body's axes into the world's, of a unit quaternion."""
    w, x, y, z = quaternion
    return jnp.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def mobility_of(inertia_m2: Float[jax.Array, " 3"], turned: jax.Array) -> Float[jax.Array, "3 3"]:
    """From angular momentum to spin, both over the mass, of a body turned by a matrix."""
    return (turned / inertia_m2) @ turned.T


def spin_rad_s(solid: Solid, pose: Pose) -> Float[jax.Array, " 3"]:
    """The angular velocity along the world's axes."""
    return mobility_of(solid.inertia_m2, rotation(pose.quaternion)) @ pose.momentum_m2_s


def levers_m(solid: Solid, quaternion: jax.Array) -> Float[jax.Array, "corner 3"]:
    """From the centre to the corners' lowest points, along the world's axes."""
    down = jnp.array([0.0, 0.0, -1.0]) * solid.round_m
    return solid.corners_m @ rotation(quaternion).T + down


def gaps_m(solid: Solid, pose: Pose) -> Float[jax.Array, " corner"]:
    """How high the corners are above the plane."""
    return pose.position_m[2] + levers_m(solid, pose.quaternion)[:, 2] - solid.floor_m


def climbs_m_s(solid: Solid, pose: Pose) -> Float[jax.Array, " corner"]:
    """How fast the corners rise."""
    levers, spin = levers_m(solid, pose.quaternion), spin_rad_s(solid, pose)
    return pose.velocity_m_s[2] + spin[0] * levers[:, 1] - spin[1] * levers[:, 0]


def turned_on(
    inertia_m2: Float[jax.Array, " 3"],
    quaternion: jax.Array,
    momentum: jax.Array,
    spent_s: jax.Array,
) -> Float[jax.Array, " 4"]:
    """The quaternion of a body that turns freely for a time; principal moments over the mass."""

    def rate(at: jax.Array, _: object) -> jax.Array:
        spin = mobility_of(inertia_m2, rotation(at / jnp.linalg.norm(at))) @ momentum
        w, v = at[0], at[1:]
        return 0.5 * jnp.concatenate([-(spin @ v)[None], w * spin + jnp.cross(spin, v)])

    found = runge_kutta(rate, quaternion, 0.0, spent_s)
    return found / jnp.linalg.norm(found)


PUSH_OUT = 0.2  # share of a step's rounding that is taken back in the next


class Masses(NamedTuple):
    """What bodies have against being moved."""

    inertia_m2: Float[jax.Array, "body 3"]  # principal moments over the masses
    inverse_kg: Float[jax.Array, " body"]  # one over the masses


class Contacts(NamedTuple):
    """Where bodies touch the plane, and each other: of each pair in `pairs` its points."""

    corners: Corners
    points: Sequence[Points] = ()
    pairs: Sequence[tuple[int, int]] = ()


Impulses = tuple[jax.Array, tuple[jax.Array, ...]]
"""At the corners, over the mass, `[body, corner, 3]`; at the points of each pair `[point]`."""


def spins_rad_s(pose: Pose, inertia_m2: jax.Array) -> Float[jax.Array, "body 3"]:
    """Angular velocities along the world's axes, of poses with a leading axis."""
    mobility = jax.vmap(mobility_of)(inertia_m2, jax.vmap(rotation)(pose.quaternion))
    return jnp.einsum("bij,bj->bi", mobility, pose.momentum_m2_s)


def least_rises_m_s(gaps_m: jax.Array, spent_s: jax.Array) -> jax.Array:
    """Speeds at which what lasts may rise after a step: it closes gaps, and takes overlaps back."""
    over = jnp.where(spent_s > 0, spent_s, 1.0)
    return jnp.where(gaps_m > 0, -gaps_m, -PUSH_OUT * gaps_m) / over


def struck(pose: Pose, masses: Masses, contacts: Contacts) -> tuple[Pose, Impulses]:
    """The poses `[body]` after the impulses of contacts."""
    turned = jax.vmap(rotation)(pose.quaternion)
    mobility = jax.vmap(mobility_of)(masses.inertia_m2, turned)
    spin = jnp.einsum("bij,bj->bi", mobility, pose.momentum_m2_s)
    after, stands, pushes = after_impulses(
        Speeds(pose.velocity_m_s, spin), *contacts, mobility, masses.inverse_kg
    )
    own = jnp.einsum("bji,bj->bi", turned, after.spin - spin) * masses.inertia_m2
    momentum = pose.momentum_m2_s + jnp.einsum("bij,bj->bi", turned, own)
    return pose._replace(velocity_m_s=after.velocity, momentum_m2_s=momentum), (stands, pushes)


def stepped(
    pose: Pose,
    masses: Masses,
    spent_s: jax.Array,
    at_middle: Callable[[Pose], tuple[jax.Array, Contacts]],
) -> tuple[Pose, Impulses]:
    """The poses `[body]` after a time, and what the contacts did in it.

    `at_middle`: poses half of the way, with the speeds of the beginning, to accelerations without
    contacts `[body, 3]` and the contacts that last.
    """
    half_s = 0.5 * spent_s
    middle = _drifted(pose, masses, half_s)
    a, contacts = at_middle(middle)
    pushed = middle._replace(velocity_m_s=pose.velocity_m_s + spent_s * a)
    after, impulses = struck(pushed, masses, contacts)
    place = pose.position_m + half_s * (pose.velocity_m_s + after.velocity_m_s)
    return _drifted(after, masses, half_s)._replace(position_m=place), impulses


def _drifted(pose: Pose, masses: Masses, spent_s: jax.Array) -> Pose:
    """The poses after a time without forces."""
    turn = jax.vmap(turned_on, (0, 0, 0, None))
    return pose._replace(
        position_m=pose.position_m + spent_s * pose.velocity_m_s,
        quaternion=turn(masses.inertia_m2, pose.quaternion, pose.momentum_m2_s, spent_s),
    )

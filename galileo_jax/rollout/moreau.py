"""Bodies in space under impulses: Moreau's midpoint step, and the jump of an impact.

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

from galileo_jax.rollout.body import Pose, mobility_of, rotation, turned_on
from galileo_jax.rollout.box_impulses import Corners, Points, Speeds, after_impulses

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

    Args:
      pose: at the beginning.
      masses: of the bodies.
      spent_s: the time.
      at_middle: poses half of the way, with the speeds of the beginning, to accelerations without
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

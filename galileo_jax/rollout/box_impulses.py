"""What boxes do to each other and the table to them: impulses that only push, with friction.

For every point that touches, with p its impulse and u the speed at which it opens afterwards,

    0 <= p_n,  u_n >= least,  p_n (u_n - least) = 0

and at corners on the plane Coulomb friction, p_t their impulse along it; faces are smooth:

    |p_t| <= mu p_n, and where it slips  p_t = -mu p_n u_t / |u_t|

Found by going round all points, each time with the others' impulses given (projected
Gauss-Seidel). `least` says what a contact is: 0 where it lasts, -e u_n where it is hit.

Source: Moreau (1988), Unilateral contact and dry friction in finite freedom dynamics; Jourdan,
Alart and Jean (1998), A Gauss-Seidel like algorithm to solve frictional contact problems, Comput.
Methods Appl. Mech. Eng. 155, 31.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

SWEEPS = 60  # at most
CONVERGED_M_S = 1e-11  # of one sweep: they converge slowly, and steps add up
TINY = 1e-30  # keeps the derivative of a length finite at 0


class Speeds(NamedTuple):
    """Of all boxes: velocities, m/s, and spins, rad/s, each `[box, 3]`."""

    velocity: Float[jax.Array, "box 3"]
    spin: Float[jax.Array, "box 3"]


Carry = tuple[jax.Array, Speeds, jax.Array]
"""Impulses, speeds, and the most by which a sweep has changed any."""


class Corners(NamedTuple):
    """The corners on which boxes stand."""

    levers_m: Float[jax.Array, "box corner 3"]  # from the centres
    least_m_s: Float[jax.Array, "box corner"]  # least speed at which each may rise afterwards
    touches: Bool[jax.Array, "box corner"]  # of which anything is asked
    friction: Float[jax.Array, " box"]
    # Impulses over the mass with which the sweeps start
    guess_m_s: Float[jax.Array, "box corner 3"]


class Points(NamedTuple):
    """The points at which one box touches another; the numbers of these are `boxes`."""

    levers_m: Float[jax.Array, "2 point 3"]  # from the two centres
    normal: Float[jax.Array, " 3"]  # from the first to the second
    least_m_s: Float[jax.Array, " point"]  # least speed at which each opens afterwards
    touches: Bool[jax.Array, " point"]
    guess_ns: Float[jax.Array, " point"]  # impulses with which the sweeps start


def after_impulses(
    speeds: Speeds,
    corners: Corners,
    points: Sequence[Points],
    boxes: Sequence[tuple[int, int]],
    mobility: Float[jax.Array, "box 3 3"],
    inverse_kg: Float[jax.Array, " box"],
) -> tuple[Speeds, jax.Array, tuple[jax.Array, ...]]:
    """Speeds after the impulses at all corners and at the points of pairs, and these impulses.

    `mobility`: from angular momentum over the mass to spin. `inverse_kg`: one over the masses.
    """
    of_corner = jax.vmap(_Corner.of, (Corners._make((0, 0, 0, None, 0)), None))
    stands = jax.vmap(of_corner)(corners, mobility)
    orders = [jnp.argsort(~of.touches, stable=True) for of in points]
    points = [_ordered(of, order) for of, order in zip(points, orders, strict=True)]
    of_point = jax.vmap(_Point.of, (Points._make((1, None, 0, 0, 0)), None, None))
    pairs = [
        of_point(of, mobility[jnp.asarray(both)], inverse_kg[jnp.asarray(both)])
        for of, both in zip(points, boxes, strict=True)
    ]
    standing = jnp.where(corners.touches[..., None], corners.guess_m_s, 0.0)
    between = tuple(jnp.where(of.touches, of.guess_ns, 0.0) for of in points)

    def sweep(carry):
        done, _, speeds, standing, between = carry
        changed, pushes = jnp.zeros(()), []
        for of, own, both, impulses in zip(points, pairs, boxes, between, strict=True):
            step, carry = _at_point(own, jnp.asarray(both)), (impulses, speeds, changed)
            impulses, speeds, changed = jax.lax.fori_loop(0, jnp.sum(of.touches), step, carry)
            pushes.append(impulses)
        carry = standing, speeds, changed
        step = _at_corner(stands)
        standing, speeds, changed = jax.lax.fori_loop(0, standing.shape[1], step, carry)
        return done + 1, changed, speeds, standing, tuple(pushes)

    def goes_on(carry) -> jax.Array:
        return (carry[0] < SWEEPS) & (carry[1] > CONVERGED_M_S)

    turned = jnp.sum(jnp.cross(corners.levers_m, standing), axis=1)
    velocity = speeds.velocity + jnp.sum(standing, axis=1)
    spin = speeds.spin + jnp.einsum("bij,bj->bi", mobility, turned)
    any_touches = jnp.any(corners.touches)
    for of, own, both, impulses in zip(points, pairs, boxes, between, strict=True):
        any_touches = any_touches | jnp.any(of.touches)
        velocity = velocity.at[jnp.asarray(both)].add(jnp.einsum("p,pij->ij", impulses, own.pushes))
        spin = spin.at[jnp.asarray(both)].add(jnp.einsum("p,pij->ij", impulses, own.turns))
    asked = jnp.where(any_touches, 1.0, 0.0)  # in flight there is nothing to sweep
    begin = (0, asked, Speeds(velocity, spin), standing, between)
    _, _, speeds, standing, between = jax.lax.while_loop(goes_on, sweep, begin)
    given = zip(between, orders, strict=True)
    return speeds, standing, tuple(jnp.zeros_like(own).at[order].set(own) for own, order in given)


def _ordered(points: Points, order: jax.Array) -> Points:
    """The same points; those that touch come first, and no others need be looked at."""
    return Points(
        points.levers_m[:, order],
        points.normal,
        points.least_m_s[order],
        points.touches[order],
        points.guess_ns[order],
    )


def _at_point(own: "_Point", boxes: jax.Array) -> Callable[[jax.Array, Carry], Carry]:
    """What a sweep does at point k of two boxes."""

    def step(k: jax.Array, carry: Carry) -> Carry:
        impulses, speeds, changed = carry
        each = jax.tree.map(lambda leaf: leaf[k], own)
        change, speeds = each.swept(impulses[k], speeds, boxes)
        most = jnp.maximum(changed, jnp.abs(change) * each.moves[0])
        return impulses.at[k].add(change), speeds, most

    return step


def _at_corner(stands: "_Corner") -> Callable[[jax.Array, Carry], Carry]:
    """What a sweep does at corner k of every box."""

    def step(k: jax.Array, carry: Carry) -> Carry:
        standing, speeds, changed = carry
        each = jax.tree.map(lambda leaf: leaf[:, k], stands)
        change, speeds = jax.vmap(_Corner.swept)(each, standing[:, k], speeds)
        most = jnp.maximum(changed, jnp.max(jnp.abs(change)))
        return standing.at[:, k].add(change), speeds, most

    return step


class _Corner(NamedTuple):
    """One corner on the table, per mass of its box."""

    at: Corners
    turns: jax.Array  # mobility times the cross product with the lever
    rises: jax.Array  # how fast a unit impulse makes it upwards
    slides: jax.Array  # and the most along the table

    @classmethod
    def of(cls, at: Corners, mobility: jax.Array) -> "_Corner":
        skew = jnp.cross(jnp.eye(3), at.levers_m)
        matrix = jnp.eye(3) - skew @ mobility @ skew
        a, b, c = matrix[0, 0], matrix[1, 1], matrix[0, 1]
        slides = 0.5 * (a + b) + jnp.sqrt(0.25 * (a - b) ** 2 + c**2 + TINY)
        return cls(at, mobility @ skew, matrix[2, 2], slides)

    def swept(self, impulse: jax.Array, speeds: Speeds) -> tuple[jax.Array, Speeds]:
        """The change of its impulse, and the box' speeds after it."""
        velocity, spin = speeds
        u = velocity + jnp.cross(spin, self.at.levers_m)
        push = jnp.maximum(impulse[2] - (u[2] - self.at.least_m_s) / self.rises, 0.0)
        wanted = impulse[:2] - u[:2] / self.slides
        size = jnp.sqrt(jnp.sum(wanted**2) + TINY)
        rub = wanted * jnp.minimum(1.0, self.at.friction * push / size)
        change = jnp.where(self.at.touches, jnp.append(rub, push), 0.0) - impulse
        return change, Speeds(velocity + change, spin + self.turns @ change)


class _Point(NamedTuple):
    """One point between two boxes: what a unit impulse does there to both, `[2, ...]`."""

    at: Points
    arms: jax.Array  # levers x normal
    pushes: jax.Array  # velocities that it brings
    turns: jax.Array  # and spins
    moves: jax.Array  # one over the masses
    opens: jax.Array  # how fast it opens the point

    @classmethod
    def of(cls, at: Points, mobility: jax.Array, inverse_kg: jax.Array) -> "_Point":
        sides, arms = jnp.array([-1.0, 1.0]), jnp.cross(at.levers_m, at.normal)
        per_push = (sides * inverse_kg)[:, None]
        turns = per_push * jnp.einsum("bij,bj->bi", mobility, arms)
        opens = jnp.sum(inverse_kg) + jnp.sum(sides[:, None] * arms * turns)
        return cls(at, sides[:, None] * arms, per_push * at.normal, turns, inverse_kg, opens)

    def swept(
        self, impulse: jax.Array, speeds: Speeds, boxes: jax.Array
    ) -> tuple[jax.Array, Speeds]:
        """The change of its impulse, and the boxes' speeds after it."""
        velocity, spin = speeds.velocity[boxes], speeds.spin[boxes]
        u = (velocity[1] - velocity[0]) @ self.at.normal + jnp.sum(self.arms * spin)
        new = jnp.maximum(impulse - (u - self.at.least_m_s) / self.opens, 0.0)
        change = jnp.where(self.at.touches, new, 0.0) - impulse
        return change, Speeds(
            speeds.velocity.at[boxes].add(change * self.pushes),
            speeds.spin.at[boxes].add(change * self.turns),
        )

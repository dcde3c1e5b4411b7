"""What boxes do to each other and the table to them: impulses that only push, with friction.

For every point that touches, with p its impulse and u the speed at which it opens afterwards,

    0 <= p_n,  u_n >= least,  p_n (u_n - least) = 0

and at corners that stand on the table Coulomb friction, as in `body_contact`; faces are smooth.
Found by going round all points, each time with the others' impulses given (projected
Gauss-Seidel). The sources are `body_contact`'s.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Bool, Float

SWEEPS = 60  # at most
CONVERGED_M_S = 1e-10
TINY = 1e-30  # keeps the derivative of a length finite at 0


class Speeds(NamedTuple):
    """Of all boxes: velocities, m/s, and spins, rad/s, each `[box, 3]`."""

    velocity: Float[jax.Array, "box 3"]
    spin: Float[jax.Array, "box 3"]


class Corners(NamedTuple):
    """The corners on which boxes stand.

    Attributes:
      levers_m: `[box, corner, 3]`, from the centres.
      least_m_s: `[box, corner]`, least speed at which each may rise afterwards.
      touches: `[box, corner]`, of which anything is asked.
      friction: `[box]`.
      carries_m_s: how much of each box' weight is at each corner at first: the sweeps' start.
    """

    levers_m: Float[jax.Array, "box corner 3"]
    least_m_s: Float[jax.Array, "box corner"]
    touches: Bool[jax.Array, "box corner"]
    friction: Float[jax.Array, " box"]
    carries_m_s: Float[jax.Array, " box"]


class Points(NamedTuple):
    """The points at which one box touches another; the numbers of these are `boxes`.

    Attributes:
      levers_m: `[2, point, 3]`, from the two centres.
      normal: `[3]`, from the first to the second.
      least_m_s: `[point]`, least speed at which each opens afterwards.
      touches: `[point]`.
    """

    levers_m: Float[jax.Array, "2 point 3"]
    normal: Float[jax.Array, " 3"]
    least_m_s: Float[jax.Array, " point"]
    touches: Bool[jax.Array, " point"]


def after_impulses(
    speeds: Speeds,
    corners: Corners,
    points: Sequence[Points],
    boxes: Sequence[tuple[int, int]],
    mobility: Float[jax.Array, "box 3 3"],
    inverse_kg: Float[jax.Array, " box"],
) -> Speeds:
    """Speeds after the impulses at all corners and points.

    Args:
      speeds: before them.
      corners: on the table.
      points: of each pair in `boxes`.
      boxes: which these are, `(one, other)`.
      mobility: from angular momentum over the mass to spin.
      inverse_kg: one over the masses.
    """
    count, num = corners.touches.shape
    tables = [
        [_Corner.of(corners, mobility, i, k) for k in range(num)] for i in range(count)
    ]
    pairs = [
        [_Point.of(of, both, mobility, inverse_kg, k) for k in range(of.touches.shape[0])]
        for of, both in zip(points, boxes, strict=True)
    ]
    weight = jnp.where(corners.touches, corners.carries_m_s[:, None], 0.0)
    standing = jnp.zeros((count, num, 3)).at[:, :, 2].set(weight)
    between = tuple(jnp.zeros(of.touches.shape) for of in points)

    def sweep(carry):
        done, _, velocity, spin, standing, between = carry
        v, w = list(velocity), list(spin)
        stands = [[standing[i, k] for k in range(num)] for i in range(count)]
        pushes = [list(each) for each in between]
        changed = jnp.zeros(())
        for own, both, impulses in zip(pairs, boxes, pushes, strict=True):
            for k, point in enumerate(own):
                impulses[k], by = point.swept(impulses[k], v, w, both)
                changed = jnp.maximum(changed, jnp.abs(by) * inverse_kg[both[0]])
        for i, own in enumerate(tables):
            for k, corner in enumerate(own):
                change, v[i], w[i] = corner.swept(stands[i][k], v[i], w[i])
                stands[i][k] = stands[i][k] + change
                changed = jnp.maximum(changed, jnp.max(jnp.abs(change)))
        return (
            done + 1,
            changed,
            jnp.stack(v),
            jnp.stack(w),
            jnp.stack([jnp.stack(each) for each in stands]),
            tuple(jnp.stack(each) for each in pushes),
        )

    def goes_on(carry) -> jax.Array:
        return (carry[0] < SWEEPS) & (carry[1] > CONVERGED_M_S)

    velocity = speeds.velocity + jnp.sum(standing, axis=1)
    turned = jnp.sum(jnp.cross(corners.levers_m, standing), axis=1)
    spin = speeds.spin + jnp.einsum("bij,bj->bi", mobility, turned)
    any_touches = jnp.any(corners.touches)
    for of in points:
        any_touches = any_touches | jnp.any(of.touches)
    asked = jnp.where(any_touches, 1.0, 0.0)
    start = (0, asked, velocity, spin, standing, between)
    _, _, velocity, spin, _, _ = jax.lax.while_loop(goes_on, sweep, start)
    return Speeds(velocity, spin)


class _Corner(NamedTuple):
    """One corner on the table, per mass of its box."""

    lever: jax.Array
    turns: jax.Array  # mobility times the cross product with the lever
    rises: jax.Array  # how fast a unit impulse makes it upwards
    slides: jax.Array  # and the most along the table
    least: jax.Array
    touches: jax.Array
    friction: jax.Array

    @classmethod
    def of(cls, corners: Corners, mobility: jax.Array, i: int, k: int) -> "_Corner":
        lever = corners.levers_m[i, k]
        skew = _skew(lever)
        matrix = jnp.eye(3) - skew @ mobility[i] @ skew
        a, b, c = matrix[0, 0], matrix[1, 1], matrix[0, 1]
        slides = 0.5 * (a + b) + jnp.sqrt(0.25 * (a - b) ** 2 + c**2 + TINY)
        return cls(
            lever,
            mobility[i] @ skew,
            matrix[2, 2],
            slides,
            corners.least_m_s[i, k],
            corners.touches[i, k],
            corners.friction[i],
        )

    def swept(
        self, impulse: jax.Array, velocity: jax.Array, spin: jax.Array
    ) -> tuple[jax.Array, jax.Array, jax.Array]:
        """The change of its impulse, and the box' speeds after it."""
        u = velocity + jnp.cross(spin, self.lever)
        push = jnp.maximum(impulse[2] - (u[2] - self.least) / self.rises, 0.0)
        wanted = impulse[:2] - u[:2] / self.slides
        size = jnp.sqrt(jnp.sum(wanted**2) + TINY)
        rub = wanted * jnp.minimum(1.0, self.friction * push / size)
        change = jnp.where(self.touches, jnp.append(rub, push), 0.0) - impulse
        return change, velocity + change, spin + self.turns @ change


class _Point(NamedTuple):
    """One point between two boxes."""

    normal: jax.Array
    arms: tuple[jax.Array, jax.Array]  # levers x normal
    turns: tuple[jax.Array, jax.Array]  # spins that a unit impulse brings
    moves: tuple[jax.Array, jax.Array]  # one over the masses
    opens: jax.Array  # how fast a unit impulse opens it
    least: jax.Array
    touches: jax.Array

    @classmethod
    def of(
        cls,
        points: Points,
        boxes: tuple[int, int],
        mobility: jax.Array,
        inverse_kg: jax.Array,
        k: int,
    ) -> "_Point":
        arms = [jnp.cross(points.levers_m[side, k], points.normal) for side in range(2)]
        moves = [inverse_kg[i] for i in boxes]
        turns = [move * (mobility[i] @ arm) for i, arm, move in zip(boxes, arms, moves, strict=True)]
        opens = sum(move + arm @ turn for move, arm, turn in zip(moves, arms, turns, strict=True))
        return cls(
            points.normal,
            (arms[0], arms[1]),
            (turns[0], turns[1]),
            (moves[0], moves[1]),
            jnp.asarray(opens),
            points.least_m_s[k],
            points.touches[k],
        )

    def swept(
        self, impulse: jax.Array, v: list[jax.Array], w: list[jax.Array], boxes: tuple[int, int]
    ) -> tuple[jax.Array, jax.Array]:
        """Its impulse and the change of it; writes the boxes' speeds into `v` and `w`."""
        one, other = boxes
        u = (v[other] - v[one]) @ self.normal + w[other] @ self.arms[1] - w[one] @ self.arms[0]
        new = jnp.maximum(impulse - (u - self.least) / self.opens, 0.0)
        change = jnp.where(self.touches, new, 0.0) - impulse
        v[one] = v[one] - change * self.moves[0] * self.normal
        v[other] = v[other] + change * self.moves[1] * self.normal
        w[one] = w[one] - change * self.turns[0]
        w[other] = w[other] + change * self.turns[1]
        return impulse + change, change


def _skew(lever: jax.Array) -> jax.Array:
    x, y, z = lever
    zero = jnp.zeros_like(x)
    return jnp.stack(
        [jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])]
    )

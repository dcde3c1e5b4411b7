"""Discs on a level table: when they meet each other or a wall, and what the hit does to speeds.

Rims meet where they face each other, and are pushed there: round ones on the line of their middles.
Of one that is not round

h(a) = r (1 + c cos 2 (a - turned) + s sin 2 (a - turned))

is how far a rim reaches in the direction `a` from the disc's middle (its support function); the
point that it reaches there is h along `a` and h' across it, counter-clockwise. Two rims are apart
by the most that a direction from one middle to the other shows,

    gap = max over a of  d(a) - h_1(a) - h_2(a)

with d(a) the middles' distance along `a` (h is the same in the opposite direction).

Source: Santaló, Integral Geometry and Geometric Probability (1976), chapter 1 (support functions).
"""

import functools
import math
from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.model.effects.effect import Rims, Walls
from galileo_jax.rollout.events import PLASTIC_M_S, newton, reaches_s
from galileo_jax.rollout.motion import Dynamics

ROOT2 = math.sqrt(2.0)
TOUCH_M_S = 1e-9
NEWTON_STEPS = 3
CLOSED_M = 1e-7  # rims so near touch
# Newton's method, from the middles' direction on: rims that touch, up to 0.1 from round, are off by
# 4e-10 rad at most (400 draws), and their gap by rounding.
FACING_STEPS = 3


def length(vectors: jax.Array) -> jax.Array:
    """Over the last axis, with a finite derivative at 0."""
    square = jnp.sum(vectors**2, axis=-1)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


class Rim(NamedTuple):
    """The rims of some discs, or of one."""

    radius_m: jax.Array  # `[...]`, their mean
    oval: jax.Array  # `[..., 2]`, c and s
    turned_rad: jax.Array  # `[...]`, since c and s were stated

    def reach_m(self, direction_rad: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
        """h, h' and h'' in a direction."""
        twice = 2.0 * (direction_rad - self.turned_rad)
        cos, sin = jnp.cos(twice), jnp.sin(twice)
        c, s = self.oval[..., 0], self.oval[..., 1]
        bulge = self.radius_m * (c * cos + s * sin)
        return (
            self.radius_m + bulge,
            2.0 * self.radius_m * (s * cos - c * sin),
            -4.0 * bulge,
        )

    def of(self, index: int | jax.Array) -> "Rim":
        """That of one disc, or those of some."""
        return Rim(self.radius_m[index], self.oval[index], self.turned_rad[index])


def facing(apart_m: Float[jax.Array, " 2"], one: Rim, other: Rim) -> tuple[jax.Array, jax.Array]:
    """The direction in which two rims face each other, rad, and their gap, m.

    `apart_m`: from the middle of one to that of the other.
    """
    distance = jnp.sqrt(jnp.sum(apart_m**2))
    straight = jnp.arctan2(apart_m[1], apart_m[0])

    def nearer(_: Any, beside: jax.Array) -> jax.Array:
        rims = [rim.reach_m(straight + beside) for rim in (one, other)]
        slope, bend = (sum(rim[k] for rim in rims) for k in (1, 2))
        off = distance * jnp.sin(beside) + slope
        return beside - off / (distance * jnp.cos(beside) + bend)

    beside = jax.lax.fori_loop(0, FACING_STEPS, nearer, jnp.zeros_like(straight))
    direction = straight + beside
    reach = one.reach_m(direction)[0] + other.reach_m(direction)[0]
    return direction, distance * jnp.cos(beside) - reach


class Discs(NamedTuple):
    """All discs of one rollout, or their rates of change."""

    place_m: Float[jax.Array, "object 3"]  # x, y and r turning / sqrt(2)
    speed_m_s: Float[jax.Array, "object 3"]
    way_m: Float[jax.Array, " object"]  # how far each has come along its curve

    def after(self, a: jax.Array, t: jax.Array) -> "Discs":
        """At a constant acceleration `[object, 3]`."""
        along = length(self.speed_m_s[:, :2])
        return Discs(
            self.place_m + self.speed_m_s * t + 0.5 * a * t**2,
            self.speed_m_s + a * t,
            self.way_m + along * t,
        )


class Table(NamedTuple):
    """What does not change in a rollout."""

    law: Dynamics  # the equations of motion
    rims: Rims  # what a hit does
    radius_m: jax.Array  # `[object]`, true
    walls: Walls | None  # true; None where there are none
    # `[object, 2]`, where discs press on the table, see `Effect.pressure`; None: in the middle
    pressure: Any | None
    # `[object, 2]`, how far from round rims are, see `Effect.oval`; None: all are round
    oval: Any | None

    def rim(self, discs: Discs) -> Rim | None:
        """The rims as they are turned; None where all are round."""
        if self.oval is None:
            return None
        return Rim(self.radius_m, self.oval, ROOT2 * discs.place_m[:, 2] / self.radius_m)


def hit_times_s(
    discs: Discs, a: jax.Array, pairs: np.ndarray, left_s: jax.Array, table: Table
) -> jax.Array:
    """When the rims of each pair meet, s `[pair]`; inf where they do not within `left_s`."""

    def gap(pair: np.ndarray, t: jax.Array) -> tuple[jax.Array, jax.Array]:
        then = discs.after(a, t)
        normal, gap_m, _, side = _facing(then, pair, table)
        u = (then.speed_m_s[pair[1]] - then.speed_m_s[pair[0]])[:2]
        return gap_m, jnp.sum(u * normal) + ROOT2 * jnp.sum(side * then.speed_m_s[pair, 2])

    found = [_meeting_s(functools.partial(gap, pair), left_s) for pair in pairs]
    return jnp.stack(found) if found else jnp.zeros(0)


def _meeting_s(
    gap: Callable[[jax.Array], tuple[jax.Array, jax.Array]], left_s: jax.Array
) -> jax.Array:
    """When gaps close, s `[...]`; inf where not in what is left of a step.

    `gap`: a time to gaps, m, and how fast they grow.
    """
    (now, rate), (_, bends) = jax.jvp(gap, (jnp.zeros(()),), (jnp.ones(()),))
    # What presses without a speed closes within the step all the same.
    guess = jnp.where(rate < -TOUCH_M_S, reaches_s(now, -rate, -bends), jnp.inf)
    is_near = guess <= 2 * left_s
    at, left = newton(gap, jnp.where(is_near, guess, 0.0), left_s, NEWTON_STEPS)
    return jnp.where(is_near & (left < CLOSED_M) & (at <= left_s), jnp.maximum(at, 0.0), jnp.inf)


def _facing(
    discs: Discs, pair: np.ndarray, table: Table
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """Of two rims the direction in which they face each other `[2]`, and their gap, m.

    And where they touch, along and across it, as shares of their radii, each `[2]`.
    """
    one, other = (int(i) for i in pair)
    apart = (discs.place_m[other] - discs.place_m[one])[:2]
    rim = table.rim(discs)
    if rim is None:
        distance = length(apart)
        gap = distance - table.radius_m[one] - table.radius_m[other]
        return apart / distance, gap, jnp.ones(2), jnp.zeros(2)
    direction, gap = facing(apart, rim.of(one), rim.of(other))
    normal = jnp.stack([jnp.cos(direction), jnp.sin(direction)])
    return normal, gap, *_shares(rim.of(jnp.array([one, other])), direction)


def after_hit(discs: Discs, speed_m_s: jax.Array, pair: np.ndarray, table: Table) -> jax.Array:
    """Speeds `[object, 3]` after a hit of two discs, one from object `pair[0]` to `pair[1]`."""
    one, other = both = [int(i) for i in pair]
    normal, _, reach, side = _facing(discs, pair, table)
    across = jnp.stack([-normal[1], normal[0]])
    u, turning = (speed_m_s[other] - speed_m_s[one])[:2], speed_m_s[jnp.array(both), 2]
    inverse = 1.0 / table.law.mass[jnp.array(both)]
    approach = -jnp.sum(u * normal) - ROOT2 * jnp.sum(side * turning)
    slip = jnp.sum(u * across) - ROOT2 * jnp.sum(reach * turning)
    # J = m r^2 / 2: turning adds twice the inverse mass.
    gives = (
        jnp.sum(inverse * (1.0 + 2.0 * side**2)),
        jnp.sum(inverse * (1.0 + 2.0 * reach**2)),
        -2.0 * jnp.sum(inverse * reach * side),
    )
    push, rub = _impulse(approach, slip, gives, table.rims)
    impulse, turns = push * normal + rub * across, ROOT2 * (side * push - reach * rub)
    change = jnp.concatenate([impulse, turns[1:]])
    back = jnp.concatenate([-impulse, turns[:1]])
    return speed_m_s.at[other].add(change * inverse[1]).at[one].add(back * inverse[0])


def _shares(rims: Rim, direction: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Where rims touch in a direction, along and across it, as shares of their radii."""
    reach, side, _ = rims.reach_m(direction)
    return reach / rims.radius_m, side / rims.radius_m


def _impulse(
    approach: jax.Array,
    slip: jax.Array,
    gives: tuple[jax.Array, jax.Array, jax.Array],
    how: Rims | Walls,
) -> tuple[jax.Array, jax.Array]:
    """What a hit gives along and across: Newton's, and Coulomb's or as much as stops the slip.

    Args:
      approach: speed of the touching points towards each other, m/s.
      slip: across, m/s.
      gives: by how much impulses of 1 change the speed along, across, and one the other.
      how: restitution and grip.
    """
    along, across, mixed = gives
    e = jnp.where(approach > PLASTIC_M_S, how.restitution, 0.0)
    wanted = jnp.maximum((1.0 + e) * approach, 0.0)
    rub = -(along * slip + mixed * wanted) / (along * across - mixed**2)
    push = (wanted - mixed * rub) / along
    way = jnp.sign(rub)
    slides = jnp.abs(rub) > how.grip * push
    most = wanted / (along + way * how.grip * mixed)
    hits = wanted > 0
    push, rub = jnp.where(slides, most, push), jnp.where(slides, way * how.grip * most, rub)
    return jnp.where(hits, push, 0.0), jnp.where(hits, rub, 0.0)


def _before_wall(place_m: jax.Array, ends_m: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """How far centres `[object, 3]` are from a wall, m; across it towards them; along it `[2]`."""
    along = ends_m[1] - ends_m[0]
    along = along / length(along)
    left = jnp.stack([-along[1], along[0]])
    beside = (place_m[:, :2] - ends_m[0]) @ left
    side = jnp.where(beside < 0, -1.0, 1.0)
    return side * beside, side[:, None] * left, along


def _at_wall(
    discs: Discs, ends_m: jax.Array, table: Table
) -> tuple[jax.Array, jax.Array, jax.Array, jax.Array]:
    """How far rims are from a wall, m, and across it towards each disc, `[object, 2]`.

    And where they would touch, along and across that, as shares of their radii, each `[object]`.
    """
    away, normal, _ = _before_wall(discs.place_m, ends_m)
    rim = table.rim(discs)
    if rim is None:
        reach, side = jnp.ones(len(away)), jnp.zeros(len(away))
    else:
        reach, side = _shares(rim, jnp.arctan2(normal[:, 1], normal[:, 0]))
    return away - reach * table.radius_m, normal, reach, side


def bounce_times_s(discs: Discs, a: jax.Array, left_s: jax.Array, table: Table) -> jax.Array:
    """When each disc meets each wall, s `[wall, object]`; inf where not within `left_s`."""

    def one(ends_m: jax.Array) -> jax.Array:
        def gap(t: jax.Array) -> tuple[jax.Array, jax.Array]:
            then = discs.after(a, t[..., None])
            gap_m, normal, _, side = _at_wall(then, ends_m, table)
            speed = jnp.sum(then.speed_m_s[:, :2] * normal, axis=1)
            return gap_m, speed + ROOT2 * side * then.speed_m_s[:, 2]

        at = _meeting_s(gap, left_s)
        _, _, along = _before_wall(discs.place_m, ends_m)
        there = discs.after(a, jnp.where(at < jnp.inf, at, 0.0)[:, None]).place_m[:, :2] - ends_m[0]
        passes = (there @ along >= 0) & (there @ along <= length(ends_m[1] - ends_m[0]))
        return jnp.where(passes, at, jnp.inf)

    if table.walls is None:
        return jnp.zeros((0, len(table.radius_m)))
    return jax.vmap(one)(jnp.asarray(table.walls.ends_m))


def after_bounces(
    discs: Discs, bounces: Bool[jax.Array, "wall object"], table: Table
) -> tuple[jax.Array, jax.Array]:
    """Places and speeds `[object, 3]` after bounces off the walls, one wall after the other."""
    if table.walls is None:
        return discs.place_m, discs.speed_m_s

    def one(discs: Discs, at: tuple[jax.Array, jax.Array]) -> tuple[Discs, None]:
        ends_m, strikes = at
        place, speed = _after_bounce(discs, ends_m, table)
        strikes = strikes[:, None]
        place = jnp.where(strikes, place, discs.place_m)
        speed = jnp.where(strikes, speed, discs.speed_m_s)
        return discs._replace(place_m=place, speed_m_s=speed), None

    after, _ = jax.lax.scan(one, discs, (jnp.asarray(table.walls.ends_m), bounces))
    return after.place_m, after.speed_m_s


def _after_bounce(discs: Discs, ends_m: jax.Array, table: Table) -> tuple[jax.Array, jax.Array]:
    """Places and speeds `[object, 3]` of all discs, were they to strike a wall here."""
    assert table.walls is not None
    speed_m_s = discs.speed_m_s
    gap, normal, reach, side = _at_wall(discs, ends_m, table)
    # What was pressed into the wall within the step, by a thousandth of a millimetre, comes back.
    into = jnp.maximum(-gap, 0.0)
    across = jnp.stack([-normal[:, 1], normal[:, 0]], axis=1)
    turning = ROOT2 * speed_m_s[:, 2]
    approach = -jnp.sum(speed_m_s[:, :2] * normal, axis=1) - side * turning
    slip = jnp.sum(speed_m_s[:, :2] * across, axis=1) - reach * turning
    gives = 1.0 + 2.0 * side**2, 1.0 + 2.0 * reach**2, -2.0 * reach * side  # as in `after_hit`
    push, rub = _impulse(approach, slip, gives, table.walls)
    change = push[:, None] * normal + rub[:, None] * across
    turns = ROOT2 * (side * push - reach * rub)
    change = jnp.concatenate([change, turns[:, None]], axis=1)
    return discs.place_m.at[:, :2].add(into[:, None] * normal), speed_m_s + change

"""When discs meet each other or a wall, and what the hit does to their speeds.

A hit is met at its time, by Newton's method on the step itself, whose last step carries the
derivative of the instant. Rims that are not round (`oval_rims`) meet where they face each other,
and are pushed there.
"""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.model.effects.effect import Array
from galileo_jax.rollout.level_discs import ROOT2, Discs, Table, length
from galileo_jax.rollout.oval_rims import Rim, facing

PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
TOUCH_M_S = 1e-9
NEWTON_STEPS = 3
OVAL_STEPS = 3  # of Newton's method, from an even closing on
CLOSED_M = 1e-7  # rims so near touch


def hit_times_s(
    discs: Discs, a: jax.Array, pairs: np.ndarray, left_s: jax.Array, table: Table
) -> jax.Array:
    """When the rims of each pair meet, s `[pair]`; inf where they do not within `left_s`."""
    if table.oval is not None:
        found = [_oval_hit(discs, a, pair, left_s, table) for pair in pairs]
        return jnp.stack(found) if found else jnp.zeros(0)
    one, other = pairs.T
    apart = (discs.place_m[other] - discs.place_m[one])[:, :2]
    u, du = (discs.speed_m_s[other] - discs.speed_m_s[one])[:, :2], (a[other] - a[one])[:, :2]
    reach = table.radius_m[one] + table.radius_m[other]
    closing, square = jnp.sum(apart * u, axis=1), jnp.sum(u**2, axis=1)
    gap = jnp.sum(apart**2, axis=1) - reach**2
    root2 = closing**2 - square * gap
    # Pairs that press against each other without a speed close within the step all the same.
    meets = (closing < -TOUCH_M_S * reach) & (root2 > 0)
    root = jnp.sqrt(jnp.where(meets, root2, 1.0))
    at = jnp.where(meets, gap / jnp.where(meets, root - closing, 1.0), jnp.inf)
    at = jax.lax.stop_gradient(jnp.where(meets, jnp.clip(at, 0.0, left_s), 0.0))
    for _ in range(NEWTON_STEPS):
        # The last of the steps carries the derivative of the instant.
        at = jax.lax.stop_gradient(at)[:, None]
        there, speed = apart + u * at + 0.5 * du * at**2, u + du * at
        distance = length(there)
        way = jax.lax.stop_gradient(jnp.sum(there * speed, axis=1) / distance)
        at = at[:, 0] - (distance - reach) / jnp.where(way < 0, way, -jnp.inf)
    return jnp.where(meets & (at <= left_s), jnp.maximum(at, 0.0), jnp.inf)


def _oval_hit(
    discs: Discs, a: jax.Array, pair: np.ndarray, left_s: jax.Array, table: Table
) -> jax.Array:
    """As `hit_times_s`, of one pair of rims that are not round."""
    one, other = (int(i) for i in pair)

    def gap(t: jax.Array) -> tuple[jax.Array, jax.Array]:
        then = discs.after(a, t)
        rim = table.rim(then)
        assert rim is not None
        apart = (then.place_m[other] - then.place_m[one])[:2]
        direction, gap_m = facing(apart, rim.of(one), rim.of(other))
        u = (then.speed_m_s[other] - then.speed_m_s[one])[:2]
        normal = jnp.stack([jnp.cos(direction), jnp.sin(direction)])
        sides = jnp.stack([rim.of(i).reach_m(direction)[1] for i in (one, other)])
        spin = ROOT2 * then.speed_m_s[jnp.array([one, other]), 2]
        turns = jnp.sum(sides / rim.radius_m[jnp.array([one, other])] * spin)
        return gap_m, jnp.sum(u * normal) + turns

    return _meeting_s(gap, left_s)


def _meeting_s(
    gap: Callable[[jax.Array], tuple[jax.Array, jax.Array]], left_s: jax.Array
) -> jax.Array:
    """When gaps close, s `[...]`; inf where they do not within `left_s`.

    Args:
      gap: a time to gaps, m, and how fast they grow.
      left_s: what is left of the step.
    """
    now, rate = gap(jnp.zeros(()))
    meets = rate < -TOUCH_M_S
    at = jnp.where(meets, -now / jnp.where(meets, rate, -1.0), 0.0)
    left = now
    for _ in range(OVAL_STEPS):
        # The last of the steps carries the derivative of the instant.
        at = jax.lax.stop_gradient(jnp.clip(at, 0.0, left_s))
        left, rate = gap(at)
        rate = jax.lax.stop_gradient(rate)
        at = at - left / jnp.where(rate < 0, rate, -jnp.inf)
    is_there = (left < CLOSED_M) & (at <= left_s)
    return jnp.where(meets & is_there, jnp.maximum(at, 0.0), jnp.inf)


def after_hit(discs: Discs, speed_m_s: jax.Array, pair: np.ndarray, table: Table) -> jax.Array:
    """Speeds `[object, 3]` after a hit of two discs, one from object `pair[0]` to `pair[1]`."""
    both = one, other = tuple(int(i) for i in pair)
    apart = (discs.place_m[other] - discs.place_m[one])[:2]
    rim = table.rim(discs)
    if rim is None:
        normal = apart / length(apart)
        reach, side = jnp.ones(2), jnp.zeros(2)
    else:
        direction, _ = facing(apart, rim.of(one), rim.of(other))
        normal = jnp.stack([jnp.cos(direction), jnp.sin(direction)])
        reach, side = _shares(rim, direction, both)
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
    push, rub = _impulse(approach, slip, gives, table.rims.restitution, table.rims.grip)
    impulse, turns = push * normal + rub * across, ROOT2 * (side * push - reach * rub)
    change = jnp.concatenate([impulse, turns[1:]])
    back = jnp.concatenate([-impulse, turns[:1]])
    return speed_m_s.at[other].add(change * inverse[1]).at[one].add(back * inverse[0])


def _shares(
    rim: Rim, direction: jax.Array, which: Sequence[int] | None = None
) -> tuple[jax.Array, jax.Array]:
    """Where rims touch in a direction, along and across it, as shares of their radii."""
    chosen = rim if which is None else jax.tree.map(lambda each: each[jnp.array(which)], rim)
    reach, side, _ = chosen.reach_m(direction)
    return reach / chosen.radius_m, side / chosen.radius_m


def _impulse(
    approach: jax.Array,
    slip: jax.Array,
    gives: tuple[jax.Array, jax.Array, jax.Array],
    restitution: Array,
    grip: Array,
) -> tuple[jax.Array, jax.Array]:
    """What a hit gives along and across: Newton's, and Coulomb's or as much as stops the slip.

    Args:
      approach: speed of the touching points towards each other, m/s.
      slip: across, m/s.
      gives: by how much impulses of 1 change the speed along, across, and one the other.
      restitution: as in `Rims`.
      grip: as in `Rims`.
    """
    along, across, mixed = gives
    e = jnp.where(approach > PLASTIC_M_S, restitution, 0.0)
    wanted = jnp.maximum((1.0 + e) * approach, 0.0)
    rub = -(along * slip + mixed * wanted) / (along * across - mixed**2)
    push = (wanted - mixed * rub) / along
    way = jnp.sign(rub)
    slides = jnp.abs(rub) > grip * push
    most = wanted / (along + way * grip * mixed)
    hits = wanted > 0
    push, rub = jnp.where(slides, most, push), jnp.where(slides, way * grip * most, rub)
    return jnp.where(hits, push, 0.0), jnp.where(hits, rub, 0.0)


def _before_wall(place_m: jax.Array, ends_m: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """How far centres `[object, 3]` are from a wall, m; across it towards them; along it `[2]`."""
    along = ends_m[1] - ends_m[0]
    along = along / length(along)
    left = jnp.stack([-along[1], along[0]])
    beside = (place_m[:, :2] - ends_m[0]) @ left
    side = jnp.where(beside < 0, -1.0, 1.0)
    return side * beside, side[:, None] * left, along


def bounce_times_s(discs: Discs, a: jax.Array, left_s: jax.Array, table: Table) -> jax.Array:
    """When each disc meets each wall, s `[wall, object]`; inf where not within `left_s`."""
    if table.walls is None:
        return jnp.zeros((0, len(table.radius_m)))
    if table.oval is not None:
        return jnp.stack(
            [_oval_bounce(discs, a, each, left_s, table) for each in table.walls.ends_m]
        )
    found = []
    for ends in table.walls.ends_m:
        away, normal, along = _before_wall(discs.place_m, ends)
        gap = away - table.radius_m
        closing = jnp.sum(discs.speed_m_s[:, :2] * normal, axis=1)
        half = 0.5 * jnp.sum(a[:, :2] * normal, axis=1)
        # gap + closing t + half t^2 = 0, the first time from now on.
        root2 = closing**2 - 4 * half * gap
        meets = (closing < -TOUCH_M_S) & ((root2 > 0) | (gap <= 0))
        is_ahead = meets & (gap > 0)
        root = jnp.sqrt(jnp.where(is_ahead, root2, 1.0))
        at = jnp.where(is_ahead, 2 * gap / jnp.where(is_ahead, root - closing, 1.0), 0.0)
        there = discs.after(a, at[:, None]).place_m[:, :2] - ends[0]
        passes = (there @ along >= 0) & (there @ along <= length(ends[1] - ends[0]))
        found.append(jnp.where(meets & passes & (at <= left_s), at, jnp.inf))
    return jnp.stack(found)


def _oval_bounce(
    discs: Discs, a: jax.Array, ends_m: jax.Array, left_s: jax.Array, table: Table
) -> jax.Array:
    """As `bounce_times_s`, of rims that are not round and one wall."""

    def gap(t: jax.Array) -> tuple[jax.Array, jax.Array]:
        then = discs.after(a, t[..., None])
        rim = table.rim(then)
        assert rim is not None
        away, normal, _ = _before_wall(then.place_m, ends_m)
        reach, side = _shares(rim, jnp.arctan2(normal[:, 1], normal[:, 0]))
        speed = jnp.sum(then.speed_m_s[:, :2] * normal, axis=1)
        return away - reach * rim.radius_m, speed + ROOT2 * side * then.speed_m_s[:, 2]

    at = _meeting_s(gap, left_s)
    _, _, along = _before_wall(discs.place_m, ends_m)
    there = discs.after(a, jnp.where(at < jnp.inf, at, 0.0)[:, None]).place_m[:, :2] - ends_m[0]
    passes = (there @ along >= 0) & (there @ along <= length(ends_m[1] - ends_m[0]))
    return jnp.where(passes, at, jnp.inf)


def after_bounce(
    discs: Discs, speed_m_s: jax.Array, wall: int, table: Table
) -> tuple[jax.Array, jax.Array]:
    """Places and speeds `[object, 3]` of all discs, were they to strike a wall here."""
    assert table.walls is not None
    away, normal, _ = _before_wall(discs.place_m, table.walls.ends_m[wall])
    rim = table.rim(discs)
    if rim is None:
        reach, side = jnp.ones(len(away)), jnp.zeros(len(away))
    else:
        reach, side = _shares(rim, jnp.arctan2(normal[:, 1], normal[:, 0]))
    # What was pressed into the wall within the step, by a thousandth of a millimetre, comes back.
    into = jnp.maximum(reach * table.radius_m - away, 0.0)
    across = jnp.stack([-normal[:, 1], normal[:, 0]], axis=1)
    turning = ROOT2 * speed_m_s[:, 2]
    approach = -jnp.sum(speed_m_s[:, :2] * normal, axis=1) - side * turning
    slip = jnp.sum(speed_m_s[:, :2] * across, axis=1) - reach * turning
    gives = 1.0 + 2.0 * side**2, 1.0 + 2.0 * reach**2, -2.0 * reach * side  # as in `after_hit`
    push, rub = _impulse(approach, slip, gives, table.walls.restitution, table.walls.grip)
    change = push[:, None] * normal + rub[:, None] * across
    turns = ROOT2 * (side * push - reach * rub)
    change = jnp.concatenate([change, turns[:, None]], axis=1)
    return discs.place_m.at[:, :2].add(into[:, None] * normal), speed_m_s + change

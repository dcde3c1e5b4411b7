"""The rigid engine seen from above: discs that slide and turn on a level table.

Each disc is a point (x, y, s) with s = r turning / sqrt(2), whose friction has one size and points
against its velocity (`effects/laws/pucks.py`). Between events a midpoint step of 1/240 s is exact
for constant friction on a level table, and second order for every other law; a stop or a hit is
met at its time, by Newton's method on the step itself, so that the motion is a continuous function
of the parameters with the right derivatives, as in `engine_rigid`.

Rims that are not round (`oval_rims`) meet where they face each other, and are pushed there.

Discs that touch and press, or are pressed against a wall, are held apart by small plastic impacts.
Walls have no thickness: a disc is on that side on which its centre is.
"""

import math
from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import Array, Effect, Rims, Surroundings, Walls
from galileo_jax.rollout.engine_free import start_velocity
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.event_loop import recorded, step_by_events
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at
from galileo_jax.rollout.oval_rims import Rim, facing

MAX_EVENTS = 16  # within one recorded step
PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
TOUCH_M_S = 1e-9
NEWTON_STEPS = 3
OVAL_STEPS = 3  # of Newton's method, from an even closing on
CLOSED_M = 1e-7  # rims so near touch
ROOT2 = math.sqrt(2.0)


class Discs(NamedTuple):
    """All discs of one rollout, or their rates of change.

    Attributes:
      place_m, speed_m_s: `[object, 3]`, x, y and r turning / sqrt(2).
      way_m: `[object]`, how far each has come along its curve.
    """

    place_m: Float[jax.Array, "object 3"]
    speed_m_s: Float[jax.Array, "object 3"]
    way_m: Float[jax.Array, " object"]

    def after(self, a: jax.Array, t: jax.Array) -> "Discs":
        """At a constant acceleration `[object, 3]`."""
        along = _length(self.speed_m_s[:, :2])
        return Discs(
            self.place_m + self.speed_m_s * t + 0.5 * a * t**2,
            self.speed_m_s + a * t,
            self.way_m + along * t,
        )


class Table(NamedTuple):
    """What does not change in a rollout.

    Attributes:
      law: the equations of motion.
      rims: what a hit does.
      radius_m: `[object]`, true.
      walls: true; None where there are none.
      pressure: `[object, 2]`, where discs press on the table, see `Effect.pressure`; None: in the
        middle.
      oval: `[object, 2]`, how far from round rims are, see `Effect.oval`; None: all are round.
    """

    law: Dynamics
    rims: Rims
    radius_m: jax.Array
    walls: Walls | None
    pressure: Any | None
    oval: Any | None

    def rim(self, discs: Discs) -> Rim | None:
        """The rims as they are turned; None where all are round."""
        if self.oval is None:
            return None
        return Rim(self.radius_m, self.oval, ROOT2 * discs.place_m[:, 2] / self.radius_m)


def roll_out(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
    acts: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """One rollout: `[parameter]` to centres and velocities, each `[object, axis, record]`.

    The third axis, where the track has one, is the turning, rad. Of records beyond the first
    `count` places are as in the last of these.
    """
    named = {name: theta[i] for i, name in enumerate(names)}
    law = dynamics(effects, scene, named, jnp, acts)
    rims = next(found for e in effects if (found := e.rims(named, scene)) is not None)
    velocity = start_velocity(effects, named, scene)
    assert velocity is not None  # the pucks' law gives one
    seen = jnp.asarray(scene.start_m)
    shown = _magnified(effects, named, scene)
    walls = next((each for e in effects if (each := e.walls(named, scene)) is not None), None)
    if walls is not None:
        walls = walls._replace(ends_m=seen[0, :2] + (walls.ends_m - seen[0, :2]) / shown)
    beside = _sum([e.pressure(named, scene) for e in effects])
    oval = _sum([e.oval(named, scene) for e in effects])
    table = Table(law, rims, jnp.asarray(scene.half_length_m), walls, beside, oval)
    # Starts and turning as the camera's scale will show them.
    start = seen[0, :2] + (seen[:, :2] - seen[0, :2]) / shown + rims.offset_m
    discs = Discs(
        jnp.concatenate([start, jnp.zeros((len(start), 1))], axis=1),
        jnp.concatenate(
            [velocity[:, :2], (table.radius_m * velocity[:, 2] / ROOT2)[:, None]], axis=1
        ),
        jnp.zeros(len(scene.names)),
    )

    def step(discs: Discs, index: jax.Array) -> Discs:
        return _step(discs, index * dt_s, dt_s, table, scene)

    found = recorded(step, discs, num_records, count)
    place, speed = (jnp.moveaxis(each, 0, -1) for each in (found.place_m, found.speed_m_s))
    if scene.num_axes == 2:
        return place[:, :2], speed[:, :2]
    per_turn = ROOT2 / table.radius_m[:, None, None] / shown
    turned = seen[0, 2] + (seen[:, 2:, None] - seen[0, 2]) / shown + per_turn * place[:, 2:]
    return (
        jnp.concatenate([place[:, :2], turned], axis=1),
        jnp.concatenate([speed[:, :2], per_turn * speed[:, 2:]], axis=1),
    )


def _sum(found: Sequence[Any | None]) -> Any | None:
    given = [each for each in found if each is not None]
    return sum(given[1:], given[0]) if given else None


def _magnified(effects: tuple[Effect, ...], named: dict[str, Any], scene: Surroundings) -> Any:
    """How many times as large as they are the camera shows lengths (about object 1's start)."""
    origin = jnp.asarray(scene.start_m)[:, :, None]
    ends = jnp.concatenate([origin, origin + 1.0], axis=-1)
    for effect in effects:
        ends = effect.measure(ends, named, scene)
    return ends[0, 0, 1] - ends[0, 0, 0]


def _step(discs: Discs, time_s: jax.Array, dt_s: float, table: Table, scene: Surroundings) -> Discs:
    """One recorded step, event by event."""

    def advance(discs: Discs, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_next_event(discs, time_s, left_s, is_last, table, scene)

    return step_by_events(advance, discs, time_s, dt_s, MAX_EVENTS)


def _to_next_event(
    discs: Discs,
    time_s: jax.Array,
    left_s: jax.Array,
    is_last: jax.Array,
    table: Table,
    scene: Surroundings,
) -> tuple[Discs, jax.Array]:
    """Moves on to the next event, or by `left_s`; returns the discs and the time it took."""
    pairs = np.array(list(combinations(range(len(scene.names)), 2)), int).reshape(-1, 2)
    a = _acceleration(discs, time_s, table, scene)
    half = 0.5 * jnp.minimum(left_s, jnp.min(_stops(discs, a)))
    middle = discs.after(a, half)
    a = _acceleration(middle, time_s + half, table, scene)
    # What rests stays, whatever the half step before it rounds to.
    rests = (_length(discs.speed_m_s) == 0) & (_length(a) == 0)
    a = jnp.where(rests[:, None], 0.0, a)
    stops, hits = _stops(discs, a), _hits(discs, a, pairs, left_s, table)
    bounces = _bounces(discs, a, left_s, table)
    soonest = jnp.minimum(left_s, jnp.min(jnp.concatenate([stops, hits, bounces.ravel()])))
    t = jnp.where(is_last, left_s, soonest)
    moved = discs.after(a, t)
    speed = jnp.where((stops <= t)[:, None], 0.0, moved.speed_m_s)
    for k, pair in enumerate(pairs):
        struck = _struck(moved, speed, pair, table)
        speed = jnp.where(hits[k] <= t, struck, speed)
    place = moved.place_m
    for wall in range(bounces.shape[0]):
        is_hit = bounces[wall] <= t
        back, bounced = _bounced(moved._replace(place_m=place), speed, wall, table)
        place = jnp.where(is_hit[:, None], back, place)
        speed = jnp.where(is_hit[:, None], bounced, speed)
    return moved._replace(place_m=place, speed_m_s=speed), t


def _acceleration(discs: Discs, time_s: jax.Array, table: Table, scene: Surroundings) -> jax.Array:
    """Of every disc, `[object, 3]`."""
    law, speed = table.law, discs.speed_m_s
    along = _length(speed[:, :2])
    forward = speed[:, :2] / jnp.where(along > 0, along, 1.0)[:, None]
    lever = _lever(discs, table)
    slip = speed.at[:, :2].add(speed[:, 2:] * lever)
    size = _length(slip)
    drive = law.drive(state_at(discs.way_m, along, time_s, scene)) / law.inertia
    brake = law.brake(state_at(discs.way_m, size, time_s, scene)) / law.inertia
    downhill = law.gravity * jnp.stack([jnp.sin(law.ramp_rad), jnp.sin(law.table_rad)])
    pull = jnp.concatenate(
        [drive[:, None] * forward + downhill, jnp.zeros((len(scene.names), 1))], axis=1
    )
    strength = _length(pull)
    against = jnp.where(
        (size > 0)[:, None],
        slip / jnp.where(size > 0, size, 1.0)[:, None],
        pull / jnp.where(strength > 0, strength, 1.0)[:, None],
    )
    against = against.at[:, 2].add(jnp.sum(lever * against[:, :2], axis=1))
    held = (size == 0) & (strength <= brake)
    return jnp.where(held[:, None], 0.0, pull - brake[:, None] * against)


def _lever(discs: Discs, table: Table) -> jax.Array:
    """How fast the centre of the pressure moves beside the middle per r turning / sqrt(2)."""
    if table.pressure is None:
        return jnp.zeros((len(table.radius_m), 2))
    turned = ROOT2 * discs.place_m[:, 2] / table.radius_m
    cos, sin = jnp.cos(turned), jnp.sin(turned)
    x, y = table.pressure.T
    return ROOT2 * jnp.stack([-(sin * x + cos * y), cos * x - sin * y], axis=1)


def _stops(discs: Discs, a: jax.Array) -> jax.Array:
    """When each disc comes to rest at constant acceleration, s; inf where it does not."""
    size = _length(discs.speed_m_s)
    moves = size > 0
    slows = -jnp.sum(discs.speed_m_s * a, axis=1) / jnp.where(moves, size, 1.0)
    ends = moves & (slows > 0)
    return jnp.where(ends, size / jnp.where(ends, slows, 1.0), jnp.inf)


def _hits(
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
        distance = _length(there)
        way = jax.lax.stop_gradient(jnp.sum(there * speed, axis=1) / distance)
        at = at[:, 0] - (distance - reach) / jnp.where(way < 0, way, -jnp.inf)
    return jnp.where(meets & (at <= left_s), jnp.maximum(at, 0.0), jnp.inf)


def _oval_hit(
    discs: Discs, a: jax.Array, pair: np.ndarray, left_s: jax.Array, table: Table
) -> jax.Array:
    """As `_hits`, of one pair of rims that are not round."""
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


def _struck(discs: Discs, speed_m_s: jax.Array, pair: np.ndarray, table: Table) -> jax.Array:
    """Speeds `[object, 3]` after a hit of two discs, one from object `pair[0]` to `pair[1]`."""
    both = one, other = tuple(int(i) for i in pair)
    apart = (discs.place_m[other] - discs.place_m[one])[:2]
    rim = table.rim(discs)
    if rim is None:
        normal = apart / _length(apart)
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
    along = along / _length(along)
    left = jnp.stack([-along[1], along[0]])
    beside = (place_m[:, :2] - ends_m[0]) @ left
    side = jnp.where(beside < 0, -1.0, 1.0)
    return side * beside, side[:, None] * left, along


def _bounces(discs: Discs, a: jax.Array, left_s: jax.Array, table: Table) -> jax.Array:
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
        passes = (there @ along >= 0) & (there @ along <= _length(ends[1] - ends[0]))
        found.append(jnp.where(meets & passes & (at <= left_s), at, jnp.inf))
    return jnp.stack(found)


def _oval_bounce(
    discs: Discs, a: jax.Array, ends_m: jax.Array, left_s: jax.Array, table: Table
) -> jax.Array:
    """As `_bounces`, of rims that are not round and one wall."""

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
    passes = (there @ along >= 0) & (there @ along <= _length(ends_m[1] - ends_m[0]))
    return jnp.where(passes, at, jnp.inf)


def _bounced(
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
    gives = 1.0 + 2.0 * side**2, 1.0 + 2.0 * reach**2, -2.0 * reach * side  # as in `_struck`
    push, rub = _impulse(approach, slip, gives, table.walls.restitution, table.walls.grip)
    change = push[:, None] * normal + rub[:, None] * across
    turns = ROOT2 * (side * push - reach * rub)
    change = jnp.concatenate([change, turns[:, None]], axis=1)
    return discs.place_m.at[:, :2].add(into[:, None] * normal), speed_m_s + change


def _length(vectors: jax.Array) -> jax.Array:
    """Over the last axis, with a finite derivative at 0."""
    square = jnp.sum(vectors**2, axis=-1)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1.0)), 0.0)


class EngineLevel(EngineJax):
    """Discs on a level table, see the module."""

    roll_out = staticmethod(roll_out)

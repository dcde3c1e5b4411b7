"""The rigid engine: rigid bodies on their path, from event to event, in pure JAX.

What this scene shows is bodies that slide or roll along a line, rub, and knock together. Written
in that coordinate, with exact contact, the motion has no stiffness at all: between events a
midpoint step of 1/240 s is exact for constant friction and second order for every other law,
and the events (the foot, a hit, an end of slipping) are met at their time, not at the next step.

A round body has a second speed, that of its rim. Coulomb friction acts against the difference (the
slip) until it is zero. Then the body rolls as long as the friction needed for rolling does not
exceed the available friction. A body that slides is treated as one whose rim never moves, so coming
to rest is the end of slipping. The motion is a continuous function of the parameters and JAX's
derivatives of it are correct; those through soft contacts are not (docs/explanation/contact.md).
MuJoCo's engines are the check: tests/rollout/test_engines.py.
"""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.event_loop import PART, recorded, recorded_in_parts, step_by_events
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at, to_plane
from galileo_jax.rollout.rigid_bodies import (
    TOUCH_M,
    Bodies,
    Links,
    Number,
    Numbers,
    apart,
    of_group,
    with_link,
)

MAX_EVENTS = 16  # within one recorded step: foot, hit and stops, and a few bounces
PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
PAST_FOOT_M = 1e-12


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
    """One rollout: `[parameter]` to centres and velocities, each `[object, 2, record]`.

    Of records beyond the first `count` the centres are as in the last of these. `acts` `[effect]`
    as in `dynamics`.
    """
    named = {name: theta[i] for i, name in enumerate(names)}
    law = dynamics(effects, scene, named, jnp, acts)
    objects = range(len(scene.names))
    speed = tuple(law.start_speed_m_s[i] for i in objects)
    # What is pushed rolls from the hand.
    rim = tuple(v if _rolls(scene, i) else jnp.zeros_like(v) for i, v in enumerate(speed))
    start = Bodies(tuple(law.start_m[i] for i in objects), speed, rim)
    if law.is_steady:

        def part(bodies: Bodies, first: jax.Array) -> tuple[Bodies, Bodies]:
            return _exact_part(bodies, first * dt_s, dt_s, law, scene)

        found = recorded_in_parts(part, start, num_records, count)
    else:

        def step(bodies: Bodies, index: jax.Array) -> Bodies:
            return _step(bodies, index * dt_s, dt_s, law, scene)

        found = recorded(step, start, num_records, count)
    path, speed = (jnp.stack(own, axis=-1) for own in (found.path_m, found.speed_m_s))
    position, velocity = to_plane(path, speed, law.ramp_rad, law.table_rad, scene)
    return jnp.moveaxis(position, 0, -1), jnp.moveaxis(velocity, 0, -1)


def _step(
    bodies: Bodies, time_s: jax.Array, dt_s: float, law: Dynamics, scene: Surroundings
) -> Bodies:
    """One recorded step, event by event."""

    def advance(bodies: Bodies, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        after, t, _ = _to_next_event(bodies, time_s, left_s, is_last, law, scene)
        return after, t

    return step_by_events(advance, bodies, time_s, dt_s, MAX_EVENTS)


def _exact_part(
    bodies: Bodies, time_s: jax.Array, dt_s: float, law: Dynamics, scene: Surroundings
) -> tuple[Bodies, Bodies]:
    """`PART` records at once: between events accelerations are constant.

    Returns:
      the bodies at the end, and at every record: leaves `[record]`.
    """
    whole_s = PART * dt_s
    since_s = jnp.arange(PART) * dt_s

    def advance(carry: _Seen, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        bodies, seen = carry
        after, t, a = _to_next_event(bodies, time_s, left_s, is_last, law, scene)
        passed = since_s - (whole_s - left_s)  # since this phase began
        moved = _after(bodies, a, passed)
        seen = jax.tree.map(lambda new, old: jnp.where(passed >= 0, new, old), moved, seen)
        return _Seen(after, seen), t

    unseen = jax.tree.map(lambda number: jnp.broadcast_to(number, since_s.shape), bodies)
    start = _Seen(bodies, unseen)
    end = step_by_events(advance, start, time_s, whole_s, PART * MAX_EVENTS)
    return end.now, end.at_records


class _Seen(NamedTuple):
    now: Bodies
    at_records: Bodies


def _to_next_event(
    bodies: Bodies,
    time_s: jax.Array,
    left_s: jax.Array,
    is_last: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> tuple[Bodies, jax.Array, "_Accelerations"]:
    """Moves on to the next event, or by `left_s`; returns the bodies, the time it took, and how.

    When `is_last`, by `left_s` in any case: where events never end (an object in a corner from
    which both sides lead up) what is slow waits, and the others go on.
    """
    touches = bodies.touches(law, scene)
    a = _accelerations(bodies, bodies, touches, time_s, law, scene)
    events = _event_times(bodies, touches, a, left_s, law, scene)
    if not law.is_steady:
        half = 0.5 * events.soonest
        middle = _after(bodies, a, half)
        a = _accelerations(bodies, middle, touches, time_s + half, law, scene)
        events = _event_times(bodies, touches, a, left_s, law, scene)
    t = jnp.where(is_last, left_s, events.soonest)
    moved = _after(bodies, a, t)
    q, v, u = (list(numbers) for numbers in moved)
    for i in range(len(v)):
        holds = events.grip[i] <= t
        if _rolls(scene, i):
            u[i] = jnp.where(holds, v[i], u[i])
        else:
            v[i] = jnp.where(holds, 0.0, v[i])
    if scene.has_table:
        arrives = [foot <= t for foot in events.foot]
        v, u = _past_foot(v, u, arrives, time_s + t, law, scene)
        edge = [jnp.where(one < 0, -PAST_FOOT_M, 0.0) for one in v]
        q = [jnp.where(*of) for of in zip(arrives, edge, q, strict=True)]
    if len(scene.names) > 1:
        met = Bodies(tuple(q), tuple(v), tuple(u))
        v = _after_hits(met, [hit <= t for hit in events.hit], law, scene)
    for i, before in enumerate(bodies.speed_m_s):
        waits = is_last & (t > events.soonest) & (jnp.abs(before) < PLASTIC_M_S)
        q[i] = jnp.where(waits, bodies.path_m[i], q[i])
        v = [*v[:i], jnp.where(waits, 0.0, v[i]), *v[i + 1 :]]
        u[i] = jnp.where(waits, 0.0, u[i]) if _rolls(scene, i) else u[i]
    return Bodies(tuple(q), tuple(v), tuple(u)), t, a


class _Accelerations(NamedTuple):
    centre: Numbers
    rim: Numbers


def _after(bodies: Bodies, a: _Accelerations, t: jax.Array) -> Bodies:
    q, v, u = bodies
    return Bodies(
        tuple(q + v * t + 0.5 * a * t**2 for q, v, a in zip(q, v, a.centre, strict=True)),
        tuple(v + a * t for v, a in zip(v, a.centre, strict=True)),
        tuple(u + a * t for u, a in zip(u, a.rim, strict=True)),
    )


def _rolls(scene: Surroundings, i: int) -> bool:
    return bool(scene.rolls) and scene.rolls[i]


def _accelerations(
    bodies: Bodies,
    at: Bodies,
    touches: Links,
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> _Accelerations:
    """Accelerations, with the forces that act `at` a place and speed.

    Bodies that touch move as one where the rear one would otherwise be faster: groups are
    merged, each with the sum of its members' forces and masses. Of a group's members those
    that slip are braked by all their friction; those at rest hold it with up to theirs; and
    those that roll turn with it, each as long as its friction can turn it so fast.
    """
    count = len(scene.names)
    drive = law.drive(at.state(at.speed_m_s, time_s, scene))
    brake = law.brake(at.state(at.slip_m_s, time_s, scene))
    direction = [jnp.sign(slip) for slip in bodies.slip_m_s]
    sticks = [one == 0 for one in direction]
    pull = [drive[i] - direction[i] * brake[i] for i in range(count)]
    inertia = [law.inertia[i] for i in range(count)]
    rolling = [i for i in range(count) if _rolls(scene, i)]
    rest = [
        jnp.zeros_like(pull[i]) if i in rolling else jnp.where(sticks[i], brake[i], 0.0)
        for i in range(count)
    ]
    turning = {i: 1 / law.rim[i] for i in rolling}  # the inertia that rolling adds

    def each(links: Links) -> tuple[list[Number], dict[int, Number]]:
        """Accelerations, and the way those that should roll slip all the same."""
        pulls, holds = of_group(pull, links), of_group(rest, links)
        left = [
            force - jnp.clip(force, -held, held) for force, held in zip(pulls, holds, strict=True)
        ]
        masses = of_group(inertia, links)
        slips = {i: jnp.zeros_like(direction[i]) for i in rolling}

        def with_grip() -> list[Number]:
            grips = {i: sticks[i] & (slips[i] == 0) for i in rolling}
            rubs = [
                slips[i] * brake[i] if i in rolling else jnp.zeros_like(pull[i])
                for i in range(count)
            ]
            turns = [
                jnp.where(grips[i], turning[i], 0.0) if i in rolling else jnp.zeros_like(pull[i])
                for i in range(count)
            ]
            rubbed, turned = of_group(rubs, links), of_group(turns, links)
            return [(left[i] - rubbed[i]) / (masses[i] + turned[i]) for i in range(count)]

        if not rolling:
            return [force / mass for force, mass in zip(left, masses, strict=True)], slips
        a = with_grip()
        for _ in rolling:
            for i in rolling:
                fails = sticks[i] & (jnp.abs(a[i]) * turning[i] > brake[i])
                slips[i] = jnp.where(fails, jnp.sign(left[i]), slips[i])
            a = with_grip()
        return a, slips

    links = apart(count)
    a, slips = each(links)
    for _ in range(count - 1):
        for i in range(count - 1):
            links = with_link(links, i, touches[i] & (a[i] > a[i + 1]))
            a, slips = each(links)
    rim = [jnp.zeros_like(one) for one in a]
    for i in rolling:
        turned = (direction[i] + slips[i]) * brake[i] * law.rim[i]
        rim[i] = jnp.where(sticks[i] & (slips[i] == 0), a[i], turned)
    return _Accelerations(tuple(a), tuple(rim))


class _Events(NamedTuple):
    grip: Numbers
    foot: Numbers
    hit: Numbers
    soonest: jax.Array


def _event_times(
    bodies: Bodies,
    touches: Links,
    by: _Accelerations,
    left_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> _Events:
    """When each event comes at constant accelerations, s; inf where it does not."""
    grip, foot, hit = [], [], []
    q, v, a = bodies.path_m, bodies.speed_m_s, by.centre
    for i, slip in enumerate(bodies.slip_m_s):
        change = a[i] - by.rim[i] if _rolls(scene, i) else a[i]
        ends = slip * change < 0
        grip.append(jnp.where(ends, -slip / jnp.where(ends, change, 1.0), jnp.inf))
        if scene.has_table:
            toward = jnp.where(q[i] < 0, 1.0, -1.0)
            far = jnp.abs(q[i])
            comes = _reaches(far, toward * v[i], toward * a[i])
            foot.append(jnp.where(far > PAST_FOOT_M, comes, jnp.inf))
    for i, gap in enumerate(bodies.gap_m(law, scene)):
        meets = _reaches(gap, v[i] - v[i + 1], a[i] - a[i + 1])
        hit.append(jnp.where(touches[i], jnp.inf, meets))
    soonest = functools.reduce(jnp.minimum, (*grip, *foot, *hit), left_s)
    return _Events(tuple(grip), tuple(foot), tuple(hit), soonest)


def _reaches(distance: jax.Array, v: jax.Array, a: jax.Array) -> jax.Array:
    """The first time t >= 0 at which v t + a t^2 / 2 >= `distance` on the way there; inf if never.

    Where the distance is negative: as soon as the speed is not.
    """
    under_root = v**2 + 2 * a * distance
    forward = (v > 0) & ((under_root > 0) | (distance <= 0))
    turning = (v <= 0) & (a > 0)
    is_real = under_root > 0
    root = jnp.where(is_real, jnp.sqrt(jnp.where(is_real, under_root, 1.0)), 0.0)
    # For v > 0 the usual formula times its conjugate: no cancellation, and a may be zero.
    at_once = 2 * jnp.maximum(distance, 0.0) / jnp.where(forward, v + root, 1.0)
    later = (root - v) / jnp.where(turning, a, 1.0)
    return jnp.where(forward, at_once, jnp.where(turning, later, jnp.inf))


def _past_foot(
    v: list[Number],
    u: list[Number],
    arrives: list[jax.Array],
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> tuple[list[Number], list[Number]]:
    """Speeds of centres and rims after the impulse that turns those that arrive at the foot.

    Its friction is k times as large, or what ends the slip.
    """
    cos, sin = law.turn
    slips = jnp.stack([one - rim for one, rim in zip(v, u, strict=True)])
    k = law.coefficient(state_at(jnp.zeros_like(slips), slips, time_s, scene))
    speeds, rims = [], []
    for i, rim in enumerate(u):
        along, lever = v[i] * cos, law.inertia[i] * law.rim[i]
        most = k[i] * jnp.abs(v[i] * sin)
        slip = along - rim
        ends = most * (1 + lever) >= jnp.abs(slip)
        rubbed = jnp.where(ends, slip / (1 + lever), jnp.sign(slip) * most)
        turned = rim + lever * rubbed
        after = jnp.where(ends, turned, along - rubbed) * law.foot
        speeds.append(jnp.where(arrives[i], after, v[i]))
        rims.append(jnp.where(arrives[i], turned * law.foot, rim) if _rolls(scene, i) else rim)
    return speeds, rims


def _after_hits(
    bodies: Bodies, hits: list[jax.Array], law: Dynamics, scene: Surroundings
) -> list[Number]:
    """Speeds after the neighbours that `hits` names knock together.

    Impulses only push, and neighbours part at least e times as fast as they met: of all such
    speeds the nearest in kinetic energy, found by merging as in `_accelerations`. So what stands
    against a body that is hit is pushed on at once. Faces are smooth: rims keep their speeds.
    """
    v = bodies.speed_m_s
    count = len(v)
    ahead, meets = [jnp.zeros_like(v[0])], []
    for i, gap in enumerate(bodies.gap_m(law, scene)):
        meets.append(hits[i] | (gap < TOUCH_M))
        approach = v[i] - v[i + 1]
        e = jnp.where(approach > PLASTIC_M_S, law.restitution, 0.0)
        ahead.append(ahead[-1] + jnp.where(meets[i], e * approach, 0.0))
    inertia = [law.inertia[i] for i in range(count)]
    behind = [v[i] - ahead[i] for i in range(count)]
    links, common = apart(count), behind
    for _ in range(count - 1):
        for i in range(count - 1):
            links = with_link(links, i, meets[i] & (common[i] > common[i + 1]))
            momentum = of_group([m * w for m, w in zip(inertia, behind, strict=True)], links)
            masses = of_group(inertia, links)
            common = [p / m for p, m in zip(momentum, masses, strict=True)]
    any_hits = functools.reduce(jnp.logical_or, hits)
    return [jnp.where(any_hits, common[i] + ahead[i], v[i]) for i in range(count)]


class EngineRigid(EngineJax):
    """Bodies on their path, see the module."""

    roll_out = staticmethod(roll_out)

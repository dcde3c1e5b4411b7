"""The rigid engine: rigid bodies on their path, from event to event, in pure JAX.

What this scene shows is bodies that slide or roll along a line, rub, and knock together. Written
in that coordinate, with exact contact, the motion has no stiffness at all: between events
accelerations are constant if friction is, and every other law has a midpoint step of 1/240 s, which
is of second order. Events (the foot, a hit, an end of slipping) are met at their time, not at the
next step.

A round body has a second speed, that of its rim. Coulomb friction acts against the difference (the
slip) until it is zero. Then the body rolls as long as the friction needed for rolling does not
exceed the available friction. A body that slides is treated as one whose rim never moves, so coming
to rest is the end of slipping. The motion is a continuous function of the parameters and JAX's
derivatives of it are correct; those through soft contacts are not (docs/explanation/contact.md).
MuJoCo's engines are the check: tests/rollout/test_engines.py.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.events import (
    PART,
    PLASTIC_M_S,
    Motion,
    System,
    Task,
    of_task,
    step_by_events,
)
from galileo_jax.rollout.motion import Dynamics, to_plane
from galileo_jax.rollout.path_bodies import Bodies, rolls
from galileo_jax.rollout.path_impacts import after_hits, past_foot
from galileo_jax.rollout.path_motion import (
    PAST_FOOT_M,
    Accelerations,
    accelerations,
    event_times,
    moved_on,
)

MAX_EVENTS = 16  # within one recorded step: foot, hit and stops, and a few bounces


@of_task
def roll_out(task: Task) -> Motion:
    """Bodies on their path."""
    return task.motion(path_system(task))


def path_system(task: Task) -> System:
    """Bodies on their path."""
    law, scene, dt_s = task.law(), task.scene, task.dt_s
    objects = range(len(scene.names))
    speed = tuple(law.start_speed_m_s[i] for i in objects)
    # What is pushed rolls from the hand.
    rim = tuple(v if rolls(scene, i) else jnp.zeros_like(v) for i, v in enumerate(speed))
    start = Bodies(tuple(law.start_m[i] for i in objects), speed, rim)

    def advance(bodies: Bodies, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_next_event(bodies, time_s, left_s, is_last, law, scene)[:2]

    def part(bodies: Bodies, first: jax.Array) -> tuple[Bodies, Bodies]:
        return _exact_part(bodies, first * dt_s, dt_s, law, scene)

    def seen(bodies: Bodies, _: jax.Array) -> Motion:
        path, speed = (jnp.stack(own, axis=-1) for own in (bodies.path_m, bodies.speed_m_s))
        position, velocity = to_plane(path, speed, law.ramp_rad, law.table_rad, scene)
        return jnp.moveaxis(position, 0, -1), jnp.moveaxis(velocity, 0, -1)

    return System(start, advance, MAX_EVENTS, seen, part if law.is_steady else None)


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
        moved = moved_on(bodies, a, passed)
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
) -> tuple[Bodies, jax.Array, Accelerations]:
    """Moves on to the next event, or by `left_s`; returns the bodies, the time it took, and how.

    When `is_last`, by `left_s` in any case: where events never end (an object in a corner from
    which both sides lead up) what is slow waits, and the others go on.
    """
    touches = bodies.touches(law, scene)
    a = accelerations(bodies, bodies, touches, time_s, law, scene)
    events = event_times(bodies, touches, a, left_s, law, scene)
    if not law.is_steady:
        half = 0.5 * events.soonest
        middle = moved_on(bodies, a, half)
        a = accelerations(bodies, middle, touches, time_s + half, law, scene)
        events = event_times(bodies, touches, a, left_s, law, scene)
    t = jnp.where(is_last, left_s, events.soonest)
    moved = moved_on(bodies, a, t)
    q, v, u = (list(numbers) for numbers in moved)
    for i in range(len(v)):
        holds = events.grip[i] <= t
        if rolls(scene, i):
            u[i] = jnp.where(holds, v[i], u[i])
        else:
            v[i] = jnp.where(holds, 0.0, v[i])
    if scene.has_table:
        arrives = [foot <= t for foot in events.foot]
        v, u = past_foot(v, u, arrives, time_s + t, law, scene)
        edge = [jnp.where(one < 0, -PAST_FOOT_M, 0.0) for one in v]
        q = [jnp.where(*of) for of in zip(arrives, edge, q, strict=True)]
    if len(scene.names) > 1:
        met = Bodies(tuple(q), tuple(v), tuple(u))
        v = after_hits(met, [hit <= t for hit in events.hit], law, scene)
    for i, before in enumerate(bodies.speed_m_s):
        waits = is_last & (t > events.soonest) & (jnp.abs(before) < PLASTIC_M_S)
        q[i] = jnp.where(waits, bodies.path_m[i], q[i])
        v = [*v[:i], jnp.where(waits, 0.0, v[i]), *v[i + 1 :]]
        u[i] = jnp.where(waits, 0.0, u[i]) if rolls(scene, i) else u[i]
    return Bodies(tuple(q), tuple(v), tuple(u)), t, a


class EnginePath(EngineJax):
    """Bodies on their path, see the module."""

    roll_out = staticmethod(roll_out)

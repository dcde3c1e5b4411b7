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
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.event_loop import recorded, step_by_events
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at, to_plane

MAX_EVENTS = 16  # within one recorded step: foot, hit and stops, and a few bounces
PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
TOUCH_M, TOUCH_M_S = 1e-9, 1e-9
PAST_FOOT_M = 1e-12


class Bodies(NamedTuple):
    """All bodies of one rollout.

    Attributes:
      path_m, speed_m_s: `[object]`, of the centres.
      rim_m_s: `[object]`, angular velocity times radius; 0 of what does not roll. None where
        nothing does.
    """

    path_m: Float[jax.Array, " object"]
    speed_m_s: Float[jax.Array, " object"]
    rim_m_s: Float[jax.Array, " object"] | None = None

    @property
    def slip_m_s(self) -> jax.Array:
        """How fast each slides over its surface, `[object]`."""
        return self.speed_m_s if self.rim_m_s is None else self.speed_m_s - self.rim_m_s

    def gap_m(self, law: Dynamics, scene: Surroundings) -> jax.Array:
        """Between the faces of neighbours, `[object - 1]`."""
        x = self.path_m + jnp.asarray(scene.corner_m)
        half = jnp.asarray(scene.half_length_m)
        apart = x[1:] - x[:-1] - half[1:] - half[:-1]
        # What stands in the way moves once it was hit.
        has_met = self.path_m[1:] > law.start_m[1:] + TOUCH_M
        return jnp.maximum(apart - jnp.where(has_met, law.overlap_m, 0.0), 0.0)

    def touches(self, law: Dynamics, scene: Surroundings) -> jax.Array:
        """Whether neighbours rest against each other or move as one, `[object - 1]`."""
        apart = jnp.abs(self.speed_m_s[1:] - self.speed_m_s[:-1])
        return (self.gap_m(law, scene) < TOUCH_M) & (apart < TOUCH_M_S)


def roll_out(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """One rollout: `[parameter]` to centres and velocities, each `[object, 2, record]`.

    Of records beyond the first `count` the centres are as in the last of these.
    """
    law = dynamics(effects, scene, {name: theta[i] for i, name in enumerate(names)}, jnp)

    def step(bodies: Bodies, index: jax.Array) -> Bodies:
        return _step(bodies, index * dt_s, dt_s, law, scene)

    # What is pushed rolls from the hand.
    rim = law.start_speed_m_s * jnp.asarray(scene.rolls) if any(scene.rolls) else None
    start = Bodies(law.start_m, law.start_speed_m_s, rim)
    path, speed, _ = recorded(step, start, num_records, count)
    position, velocity = to_plane(path, speed, law.ramp_rad, law.table_rad, scene)
    return jnp.moveaxis(position, 0, -1), jnp.moveaxis(velocity, 0, -1)


def _step(
    bodies: Bodies, time_s: jax.Array, dt_s: float, law: Dynamics, scene: Surroundings
) -> Bodies:
    """One recorded step, event by event."""

    def advance(bodies: Bodies, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_next_event(bodies, time_s, left_s, is_last, law, scene)

    return step_by_events(advance, bodies, time_s, dt_s, MAX_EVENTS)


def _to_next_event(
    bodies: Bodies,
    time_s: jax.Array,
    left_s: jax.Array,
    is_last: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> tuple[Bodies, jax.Array]:
    """Moves on to the next event, or by `left_s`; returns the bodies and the time it took.

    When `is_last`, by `left_s` in any case: where events never end (an object in a corner from
    which both sides lead up) what is slow waits, and the others go on.
    """
    touches = bodies.touches(law, scene)
    at_start = _accelerations(bodies, bodies, touches, time_s, law, scene)
    half = 0.5 * _event_times(bodies, touches, at_start, left_s, law, scene).soonest
    middle = _after(bodies, at_start, half)
    a = _accelerations(bodies, middle, touches, time_s + half, law, scene)
    events = _event_times(bodies, touches, a, left_s, law, scene)
    t = jnp.where(is_last, left_s, events.soonest)
    q, v, u = _after(bodies, a, t)
    holds = events.grip <= t
    if u is not None:
        u = jnp.where(holds & jnp.asarray(scene.rolls), v, u)
    v = jnp.where(holds, 0.0 if u is None else u, v)
    if scene.has_table:
        arrives = events.foot <= t
        v, u = _past_foot(v, u, arrives, time_s + t, law, scene)
        q = jnp.where(arrives, jnp.where(v < 0, -PAST_FOOT_M, 0.0), q)
    if len(scene.names) > 1:
        v = _after_hits(Bodies(q, v, u), events.hit <= t, law, scene)
    waits = is_last & (t > events.soonest) & (jnp.abs(bodies.speed_m_s) < PLASTIC_M_S)
    rests = Bodies(bodies.path_m, jnp.zeros_like(v), None if u is None else jnp.zeros_like(u))
    return jax.tree.map(functools.partial(jnp.where, waits), rests, Bodies(q, v, u)), t


class _Accelerations(NamedTuple):
    centre: jax.Array
    rim: jax.Array | None


def _after(bodies: Bodies, a: _Accelerations, t: jax.Array) -> Bodies:
    q, v, u = bodies
    rim = None if u is None or a.rim is None else u + a.rim * t
    return Bodies(q + v * t + 0.5 * a.centre * t**2, v + a.centre * t, rim)


def _accelerations(
    bodies: Bodies,
    at: Bodies,
    touches: jax.Array,
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> _Accelerations:
    """Accelerations, each `[object]`, with the forces that act `at` a place and speed.

    Bodies that touch move as one where the rear one would otherwise be faster: groups are
    merged, each with the sum of its members' forces and masses. Of a group's members those
    that slip are braked by all their friction; those at rest hold it with up to theirs; and
    those that roll turn with it, each as long as its friction can turn it so fast.
    """
    drive = law.drive(state_at(at.path_m, at.speed_m_s, time_s, scene))
    brake = law.brake(state_at(at.path_m, at.slip_m_s, time_s, scene))
    count = len(scene.names)
    direction = jnp.sign(bodies.slip_m_s)
    sticks = direction == 0
    rolls = sticks & jnp.asarray(scene.rolls or (False,) * count)
    pull = drive - direction * brake
    rest = jnp.where(sticks & ~rolls, brake, 0.0)
    turning = 1 / jnp.where(law.rim > 0, law.rim, 1.0)  # the inertia that rolling adds

    def each(together: jax.Array) -> tuple[jax.Array, jax.Array]:
        """Accelerations, and the way those that should roll slip all the same."""
        weight = together.astype(drive.dtype)
        force, held = weight @ pull, weight @ rest
        left = force - jnp.clip(force, -held, held)
        inertia, slips = weight @ law.inertia, jnp.zeros_like(direction)
        if not any(scene.rolls):
            return left / inertia, slips
        a = left / (inertia + weight @ (rolls * turning))
        for _ in range(sum(scene.rolls)):
            fails = rolls & (jnp.abs(a) * turning > brake)
            slips = jnp.where(fails, jnp.sign(left), slips)
            grips = rolls & (slips == 0)
            a = (left - weight @ (slips * brake)) / (inertia + weight @ (grips * turning))
        return a, slips

    together = jnp.eye(count, dtype=bool)
    a, slips = each(together)
    for _ in range(count - 1):
        for i in range(count - 1):
            presses = touches[i] & (a[i] > a[i + 1])
            together = _merged(together, i, presses)
            a, slips = each(together)
    if not any(scene.rolls):
        return _Accelerations(a, None)
    turned = (direction + slips) * brake * law.rim
    return _Accelerations(a, jnp.where(rolls & (slips == 0), a, turned))


def _merged(together: jax.Array, i: int, when: jax.Array) -> jax.Array:
    """The groups `[object, object]` with those of neighbours i and i + 1 made one."""
    union = together[i] | together[i + 1]
    return jnp.where(when & union[:, None], union, together)


class _Events(NamedTuple):
    grip: jax.Array
    foot: jax.Array
    hit: jax.Array
    soonest: jax.Array


def _event_times(
    bodies: Bodies,
    touches: jax.Array,
    by: _Accelerations,
    left_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> _Events:
    """When each event comes at constant accelerations, s; inf where it does not."""
    q, v, a = bodies.path_m, bodies.speed_m_s, by.centre
    slip, change = bodies.slip_m_s, a if by.rim is None else a - by.rim
    ends = slip * change < 0
    grip = jnp.where(ends, -slip / jnp.where(ends, change, 1.0), jnp.inf)
    foot = jnp.full_like(q, jnp.inf)
    if scene.has_table:
        toward = jnp.where(q < 0, 1.0, -1.0)
        foot = _reaches(jnp.abs(q), toward * v, toward * a)
        foot = jnp.where(jnp.abs(q) > PAST_FOOT_M, foot, jnp.inf)
    hit = jnp.full(len(scene.names) - 1, jnp.inf)
    if len(scene.names) > 1:
        hit = _reaches(bodies.gap_m(law, scene), v[:-1] - v[1:], a[:-1] - a[1:])
        hit = jnp.where(touches, jnp.inf, hit)
    soonest = jnp.minimum(left_s, jnp.min(jnp.concatenate([grip, foot, hit])))
    return _Events(grip, foot, hit, soonest)


def _reaches(distance: jax.Array, v: jax.Array, a: jax.Array) -> jax.Array:
    """The first time t > 0 at which v t + a t^2 / 2 = distance >= 0; inf if never."""
    under_root = v**2 + 2 * a * distance
    forward = (v > 0) & (under_root > 0)
    turning = (v <= 0) & (a > 0) & (under_root > 0)
    root = jnp.sqrt(jnp.where(forward | turning, under_root, 1.0))
    # For v > 0 the usual formula times its conjugate: no cancellation, and a may be zero.
    at_once = 2 * distance / jnp.where(forward, v + root, 1.0)
    later = (root - v) / jnp.where(turning, a, 1.0)
    return jnp.where(forward, at_once, jnp.where(turning, later, jnp.inf))


def _past_foot(
    v: jax.Array,
    u: jax.Array | None,
    arrives: jax.Array,
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> tuple[jax.Array, jax.Array | None]:
    """Speeds of centres and rims after the impulse that turns those that arrive at the foot.

    Its friction is k times as large, or what ends the slip.
    """
    cos, sin = law.turn
    rim = jnp.zeros_like(v) if u is None else u
    along, lever = v * cos, law.inertia * law.rim
    at_foot = state_at(jnp.zeros_like(v), v - rim, time_s, scene)
    most = law.coefficient(at_foot) * jnp.abs(v * sin)
    slip = along - rim
    ends = most * (1 + lever) >= jnp.abs(slip)
    rubbed = jnp.where(ends, slip / (1 + lever), jnp.sign(slip) * most)
    turned = rim + lever * rubbed
    v = jnp.where(arrives, jnp.where(ends, turned, along - rubbed) * law.foot, v)
    return v, None if u is None else jnp.where(arrives, turned * law.foot, u)


def _after_hits(bodies: Bodies, hits: jax.Array, law: Dynamics, scene: Surroundings) -> jax.Array:
    """Speeds `[object]` after the neighbours that `hits` `[object - 1]` names knock together.

    Impulses only push, and neighbours part at least e times as fast as they met: of all such
    speeds the nearest in kinetic energy, found by merging as in `_accelerations`. So what stands
    against a body that is hit is pushed on at once. Faces are smooth: rims keep their speeds.
    """
    v = bodies.speed_m_s
    meets = hits | (bodies.gap_m(law, scene) < TOUCH_M)
    approach = v[:-1] - v[1:]
    e = jnp.where(approach > PLASTIC_M_S, law.restitution, 0.0)
    parting = jnp.cumsum(jnp.where(meets, e * approach, 0.0))
    ahead = jnp.concatenate([jnp.zeros(1), parting])
    count = len(scene.names)
    together, common = jnp.eye(count, dtype=bool), v - ahead
    for _ in range(count - 1):
        for i in range(count - 1):
            together = _merged(together, i, meets[i] & (common[i] > common[i + 1]))
            weight = together.astype(v.dtype)
            common = weight @ (law.inertia * (v - ahead)) / (weight @ law.inertia)
    return jnp.where(jnp.any(hits), common + ahead, v)


class EngineRigid(EngineJax):
    """Bodies on their path, see the module."""

    roll_out = staticmethod(roll_out)

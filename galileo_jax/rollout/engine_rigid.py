"""The rigid engine: rigid bodies on their path, from event to event, in pure JAX.

What this scene shows is bodies that slide along a line, rub, and knock together. Written in
that coordinate, with exact contact, the motion has no stiffness at all: between events a
midpoint step of 1/240 s is exact for constant friction and second order for every other law,
and the events (the foot, a stop, a hit) are met at their time, not at the next step. So the
motion is a continuous function of the parameters and JAX's derivatives of it are right, which
those through compliant contacts are not (docs/contact.md). MuJoCo's engines are the check:
tests/rollout/test_engines.py.
"""

import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.effects.effect import Effect, Surroundings
from galileo_jax.rollout.chunks import MOTIONS, in_chunks
from galileo_jax.rollout.devices import over_devices
from galileo_jax.rollout.model import Model
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at, to_plane

MAX_EVENTS = 16  # within one recorded step: foot, hit and stops, and a few bounces
PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
TOUCH_M, TOUCH_M_S = 1e-9, 1e-9
PAST_FOOT_M = 1e-12
RECORDS = 128  # rollouts' lengths are rounded up to multiples, so that clips share programs


class Bodies(NamedTuple):
    """All bodies of one rollout.

    Attributes:
      path_m, speed_m_s: `[object]`.
    """

    path_m: jax.Array
    speed_m_s: jax.Array

    def gap_m(self, scene: Surroundings) -> jax.Array:
        """Between the faces of neighbours, `[object - 1]`."""
        x = self.path_m + jnp.asarray(scene.corner_m)
        half = jnp.asarray(scene.half_length_m)
        return jnp.maximum(x[1:] - x[:-1] - half[1:] - half[:-1], 0.0)

    def touches(self, scene: Surroundings) -> jax.Array:
        """Whether neighbours rest against each other or move as one, `[object - 1]`."""
        apart = jnp.abs(self.speed_m_s[1:] - self.speed_m_s[:-1])
        return (self.gap_m(scene) < TOUCH_M) & (apart < TOUCH_M_S)


class EngineRigid:
    """Simulates batches of parameter vectors; compiled once for all clips of a kind."""

    name = "rigid"

    def __init__(self, model: Model):
        self.model = model

    def simulate(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `EngineC.simulate`: centres and velocities `[batch, object, 2, record + 1]`."""
        return in_chunks(MOTIONS, lambda part: self.traceable(jnp.asarray(part)), np.asarray(theta))

    def traceable(self, theta: jax.Array) -> tuple[jax.Array, jax.Array]:
        """`simulate` in JAX: can be jitted, vmapped and differentiated."""
        model = self.model
        num_records = -(-(model.num_records + 1) // RECORDS) * RECORDS
        position, velocity = _roll_out_batch(
            model.effects + model.nuisances,
            model.names,
            num_records,
            model.record_dt_s,
            theta,
            model.scene.surroundings,
        )
        count = model.num_records + 1
        return position[..., :count], velocity[..., :count]


@functools.partial(jax.jit, static_argnums=(0, 1, 2, 3))
def _roll_out_batch(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
) -> tuple[jax.Array, jax.Array]:
    one = functools.partial(roll_out, effects, names, num_records, dt_s)
    return over_devices(jax.vmap(one, (0, None)), theta.shape[0])(theta, scene)


def roll_out(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
) -> tuple[jax.Array, jax.Array]:
    """One rollout: `[parameter]` to centres and velocities, each `[object, 2, record]`."""
    law = dynamics(effects, scene, {name: theta[i] for i, name in enumerate(names)}, jnp)

    def record(bodies: Bodies, index: jax.Array):
        return _step(bodies, index * dt_s, dt_s, law, scene), bodies

    start = Bodies(law.start_m, law.start_speed_m_s)
    _, (path, speed) = jax.lax.scan(record, start, jnp.arange(num_records))
    position, velocity = to_plane(path, speed, law.ramp_rad, law.table_rad, scene)
    return jnp.moveaxis(position, 0, -1), jnp.moveaxis(velocity, 0, -1)


def _step(
    bodies: Bodies, time_s: jax.Array, dt_s: float, law: Dynamics, scene: Surroundings
) -> Bodies:
    """One recorded step, event by event."""

    def is_left(carry: Any) -> jax.Array:
        _, left, count = carry
        return (left > 0) & (count < MAX_EVENTS)

    def phase(carry: Any) -> Any:
        bodies, left, count = carry
        is_last = count == MAX_EVENTS - 1
        bodies, spent = _to_next_event(bodies, time_s + dt_s - left, left, is_last, law, scene)
        return bodies, left - spent, count + 1

    return jax.lax.while_loop(is_left, phase, (bodies, jnp.asarray(dt_s), 0))[0]


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
    touches = bodies.touches(scene)
    at_start = _acceleration(bodies, bodies, touches, time_s, law, scene)
    half = 0.5 * _event_times(bodies, touches, at_start, left_s, scene).soonest
    middle = _after(bodies, at_start, half)
    a = _acceleration(bodies, middle, touches, time_s + half, law, scene)
    events = _event_times(bodies, touches, a, left_s, scene)
    t = jnp.where(is_last, left_s, events.soonest)
    q, v = _after(bodies, a, t)
    v = jnp.where(events.stop <= t, 0.0, v)
    if scene.has_table:
        at_foot = state_at(jnp.zeros_like(q), v, time_s + t, scene)
        turn = law.ramp_rad - law.table_rad
        kept = jnp.cos(turn) - law.coefficient(at_foot) * jnp.abs(jnp.sin(turn))
        arrives = events.foot <= t
        v = jnp.where(arrives, v * jnp.maximum(kept, 0.0) * law.foot, v)
        q = jnp.where(arrives, jnp.where(v < 0, -PAST_FOOT_M, 0.0), q)
    for i in range(len(scene.names) - 1):
        v = jnp.where(events.hit[i] <= t, _after_hit(v, i, law), v)
    waits = is_last & (t > events.soonest) & (jnp.abs(bodies.speed_m_s) < PLASTIC_M_S)
    return Bodies(jnp.where(waits, bodies.path_m, q), jnp.where(waits, 0.0, v)), t


def _after(bodies: Bodies, a: jax.Array, t: jax.Array) -> Bodies:
    q, v = bodies
    return Bodies(q + v * t + 0.5 * a * t**2, v + a * t)


def _acceleration(
    bodies: Bodies,
    at: Bodies,
    touches: jax.Array,
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> jax.Array:
    """Accelerations `[object]` with the forces that act `at` a place and speed.

    Bodies that touch move as one where the rear one would otherwise be faster: groups are
    merged, each with the sum of its members' forces and masses.
    """
    state = state_at(at.path_m, at.speed_m_s, time_s, scene)
    drive, brake = law.drive(state), law.brake(state)
    direction = jnp.sign(bodies.speed_m_s)
    count = len(scene.names)

    def each(together: jax.Array) -> jax.Array:
        weight = together.astype(drive.dtype)
        force, rub = weight @ drive, weight @ brake
        moving = force - direction * rub
        resting = force - jnp.clip(force, -rub, rub)
        return jnp.where(direction == 0, resting, moving) / (weight @ law.inertia)

    together = jnp.eye(count, dtype=bool)
    a = each(together)
    for _ in range(count - 1):
        for i in range(count - 1):
            presses = touches[i] & (a[i] > a[i + 1])
            union = together[i] | together[i + 1]
            together = jnp.where(presses & union[:, None], union, together)
            a = each(together)
    return a


class _Events(NamedTuple):
    stop: jax.Array
    foot: jax.Array
    hit: jax.Array
    soonest: jax.Array


def _event_times(
    bodies: Bodies, touches: jax.Array, a: jax.Array, left_s: jax.Array, scene: Surroundings
) -> _Events:
    """When each event comes at constant accelerations, s; inf where it does not."""
    q, v = bodies
    stops = v * a < 0
    stop = jnp.where(stops, -v / jnp.where(stops, a, 1.0), jnp.inf)
    foot = jnp.full_like(q, jnp.inf)
    if scene.has_table:
        toward = jnp.where(q < 0, 1.0, -1.0)
        foot = _reaches(jnp.abs(q), toward * v, toward * a)
        foot = jnp.where(jnp.abs(q) > PAST_FOOT_M, foot, jnp.inf)
    hit = jnp.full(len(scene.names) - 1, jnp.inf)
    if len(scene.names) > 1:
        hit = _reaches(bodies.gap_m(scene), v[:-1] - v[1:], a[:-1] - a[1:])
        hit = jnp.where(touches, jnp.inf, hit)
    soonest = jnp.minimum(left_s, jnp.min(jnp.concatenate([stop, foot, hit])))
    return _Events(stop, foot, hit, soonest)


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


def _after_hit(v: jax.Array, i: int, law: Dynamics) -> jax.Array:
    """Speeds after object i knocked against object i + 1."""
    m1, m2 = law.inertia[i], law.inertia[i + 1]
    approach = v[i] - v[i + 1]
    e = jnp.where(approach > PLASTIC_M_S, law.restitution, 0.0)
    common = (m1 * v[i] + m2 * v[i + 1]) / (m1 + m2)
    rebound = e * approach / (m1 + m2)
    return v.at[i].set(common - rebound * m2).at[i + 1].set(common + rebound * m1)

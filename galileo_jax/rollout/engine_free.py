"""The rigid engine's other half: one body that slides on nothing.

A fall, a flight, a swing on a spring, a body in a liquid: between bounces the motion is smooth,
and a Runge-Kutta step of 1/240 s is of fourth order. A bounce is met at its time, by Newton's
method on the step itself, so that the motion is a continuous function of the parameters with the
right derivatives, as in `engine_rigid`.

On a straight path the forces act along it; in the plane gravity is a vector, the effects' forces
act along the velocity, and the path is how far the body has come along its curve.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.model.effects.effect import Bounce, Effect, Surroundings
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.event_loop import recorded, step_by_events
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at

MAX_BOUNCES = 8  # within one recorded step
PLASTIC_M_S = 0.02  # slower impacts are plastic: nothing bounces for ever
NEWTON_STEPS = 3
STILL_M2_S2 = 1e-18  # keeps the derivative of the speed finite at rest


class Body(NamedTuple):
    """The body at one instant, or its rates of change.

    Attributes:
      position_m, velocity_m_s: `[axis]`, x, y (up) and, in space, z.
      way_m: how far it has come along its curve.
    """

    position_m: Float[jax.Array, " axis"]
    velocity_m_s: Float[jax.Array, " axis"]
    way_m: Float[jax.Array, ""]

    def moved(self, rate: "Body", time_s: Any) -> "Body":
        """With constant rates for a time."""
        return Body(*(value + time_s * change for value, change in zip(self, rate, strict=True)))


Rate = Callable[[Body, jax.Array], Body]


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

    Of records beyond the first `count` the centres are as in the last of these.
    """
    named = {name: theta[i] for i, name in enumerate(names)}
    law = dynamics(effects, scene, named, jnp, acts)
    start = jnp.asarray(scene.start_m)[0]
    tangent = _along(law, scene, jnp)
    floor = floor_of(effects, named, scene)
    velocity = start_velocity(effects, named, scene)
    body = Body(
        start + law.start_m[0] * tangent,
        law.start_speed_m_s[0] * tangent if velocity is None else velocity[0],
        jnp.zeros(()),
    )

    def step(body: Body, index: jax.Array) -> Body:
        return _step(body, index * dt_s, dt_s, law, scene, floor)

    bodies = recorded(step, body, num_records, count)
    return bodies.position_m.T[None], bodies.velocity_m_s.T[None]


def start_velocity(
    effects: Sequence[Effect], theta: Mapping[str, Any], scene: Surroundings
) -> Any | None:
    """The velocity in the plane at the start, `[..., object, 2]`; None on a straight path."""
    given = [e.start_velocity(theta, scene) for e in effects]
    found = [velocity for velocity in given if velocity is not None]
    return sum(found[1:], found[0]) if found else None


def floor_of(
    effects: Sequence[Effect], theta: Mapping[str, Any], scene: Surroundings
) -> Bounce | None:
    """The floor at its true height, never above the body's start.

    Its height is given as measured; what magnifies the picture magnifies its depth, too.
    """
    floor = next((f for e in effects if (f := e.bounce(theta, scene)) is not None), None)
    if floor is None:
        return None
    xp = floor.height_m.__array_namespace__()
    start = xp.asarray(scene.start_m)[0]
    higher = [[0.0, 1.0 if axis == 1 else 0.0] for axis in range(scene.num_axes)]
    seen = start[None, :, None] + xp.asarray(higher)[None]
    for effect in effects:
        seen = effect.measure(seen, theta, scene)
    magnified = seen[0, 1, 1] - seen[0, 1, 0]
    depth = xp.maximum((start[1] - floor.height_m) / magnified, xp.zeros_like(magnified))
    return floor._replace(height_m=start[1] - depth)


def rates(body: Body, time_s: Any, law: Dynamics, scene: Surroundings, rests: Any) -> Body:
    """How a body changes; one that `rests` on the floor is not pulled through it."""
    xp = body.position_m.__array_namespace__()
    if scene.moves_in_plane:
        speed = xp.sqrt(xp.sum(body.velocity_m_s**2) + STILL_M2_S2)
        tangent, way = body.velocity_m_s / speed, body.way_m
        down = [xp.sin(law.ramp_rad), -xp.cos(law.ramp_rad)]
        weight = law.gravity * xp.stack([*down, *[0.0 * down[0]] * (scene.num_axes - 2)])
    else:
        tangent = _along(law, scene, xp)
        speed = xp.sum(body.velocity_m_s * tangent)
        way = xp.sum((body.position_m - xp.asarray(scene.start_m)[0]) * tangent)
        weight = 0.0 * tangent
    state = state_at(way[None], speed[None], time_s, scene)
    a = weight + (law.drive(state) / law.inertia)[0] * tangent
    for push in law.pushes:
        a = a + push(body.velocity_m_s, time_s) / law.inertia[0]
    held = rests & _upward(scene, xp)
    return Body(body.velocity_m_s, xp.where(held, xp.maximum(a, xp.zeros_like(a)), a), speed)


def _along(law: Dynamics, scene: Surroundings, xp: Any) -> Any:
    """The direction of a straight path, `[axis]`; in the plane forward."""
    cos, sin = xp.cos(law.ramp_rad), xp.sin(law.ramp_rad)
    return xp.stack([cos, -sin, *[0.0 * cos] * (scene.num_axes - 2)])


def _upward(scene: Surroundings, xp: Any) -> Any:
    """Which axis is upward, `[axis]`."""
    return xp.asarray([axis == 1 for axis in range(scene.num_axes)])


def _step(
    body: Body,
    time_s: jax.Array,
    dt_s: float,
    law: Dynamics,
    scene: Surroundings,
    floor: Bounce | None,
) -> Body:
    """One recorded step, bounce by bounce."""
    if floor is None:
        return _runge_kutta(
            body, lambda at, t: rates(at, t, law, scene, rests=False), time_s, jnp.asarray(dt_s)
        )

    def advance(body: Body, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_bounce(body, time_s, left_s, is_last, law, scene, floor)

    return step_by_events(advance, body, time_s, dt_s, MAX_BOUNCES)


def _to_bounce(
    body: Body,
    time_s: jax.Array,
    left_s: jax.Array,
    is_last: jax.Array,
    law: Dynamics,
    scene: Surroundings,
    floor: Bounce,
) -> tuple[Body, jax.Array]:
    """Moves on to the next bounce, or by `left_s`; returns the body and the time it took.

    When `is_last`, by `left_s` in any case: what bounces faster than that rests.
    """
    height, climbs = body.position_m[1] - floor.height_m, body.velocity_m_s[1]
    rests = (height <= 0) & (climbs == 0)

    def after(spent_s: jax.Array) -> Body:
        return _runge_kutta(body, lambda at, t: rates(at, t, law, scene, rests), time_s, spent_s)

    whole = after(left_s)
    sinks = left_s * climbs - (whole.position_m[1] - body.position_m[1])
    hits = (whole.position_m[1] < floor.height_m) & ~rests
    # On a parabola through the step's ends; then on the step itself.
    a = jnp.where(hits, 2 * sinks / left_s**2, 1.0)
    root = jnp.sqrt(jnp.maximum(climbs**2 + 2 * a * height, 0.0))
    steady = jnp.abs(a) < 1e-6
    at = jnp.where(steady, -height / jnp.where(steady, climbs, 1.0), (climbs + root) / a)
    at = jax.lax.stop_gradient(jnp.clip(jnp.where(hits, at, left_s), 0.0, left_s))
    for _ in range(NEWTON_STEPS):
        # The last of the steps carries the derivative of the instant.
        there = after(jax.lax.stop_gradient(at))
        miss, speed = there.position_m[1] - floor.height_m, there.velocity_m_s[1]
        way = jax.lax.stop_gradient(jnp.where(hits & (speed < 0), speed, -1.0))
        at = jnp.where(hits, jnp.clip(jax.lax.stop_gradient(at) - miss / way, 0.0, left_s), left_s)
    there = after(at)
    vy, upward = there.velocity_m_s[1], _upward(scene, jnp)
    rebound = jnp.where(-vy > PLASTIC_M_S, -floor.restitution * vy, 0.0)
    rebound = jnp.where(is_last, 0.0, rebound)
    bounced = Body(
        jnp.where(upward, floor.height_m, there.position_m),
        jnp.where(upward, rebound, there.velocity_m_s * (1 - floor.grip)),
        there.way_m,
    )
    found = jax.tree.map(lambda one, other: jnp.where(hits, one, other), bounced, whole)
    return found, jnp.where(is_last, left_s, at)


def _runge_kutta(body: Body, rate: Rate, time_s: jax.Array, h: jax.Array) -> Body:
    """One step of the classical fourth-order method."""
    first = rate(body, time_s)
    second = rate(body.moved(first, 0.5 * h), time_s + 0.5 * h)
    third = rate(body.moved(second, 0.5 * h), time_s + 0.5 * h)
    fourth = rate(body.moved(third, h), time_s + h)
    mean = Body(
        *(
            (a + 2 * b + 2 * c + d) / 6
            for a, b, c, d in zip(first, second, third, fourth, strict=True)
        )
    )
    return body.moved(mean, h)


class EngineFree(EngineJax):
    """One body in the plane, see the module."""

    roll_out = staticmethod(roll_out)

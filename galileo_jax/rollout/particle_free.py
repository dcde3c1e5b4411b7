"""One body that slides on nothing: a fall, a flight, a swing on a spring, a body in a liquid.

Between bounces the motion is smooth, and a Runge-Kutta step of 1/240 s is of fourth order; on a
spring, whose slow swings take longer steps, it is of fifth. On a straight path the forces act along
it; in the plane gravity is a vector, the effects' forces act along the velocity, and the path is
how far the body has come along its curve. What swings on a spring may rub on its track: k m g
against its slip, which holds it where it turns back, if it can.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.model.effects.effect import SPRING, Bounce, Effect, Surroundings
from galileo_jax.rollout.events import (
    CLASSICAL,
    DORMAND_PRINCE,
    PLASTIC_M_S,
    Rubbing,
    System,
    Task,
    runge_kutta,
    to_crossing,
    to_turn,
)
from galileo_jax.rollout.motion import Dynamics, state_at, total

MAX_BOUNCES = 8  # within one recorded step
STILL_M2_S2 = 1e-18  # keeps the derivative of the speed finite at rest


class Body(NamedTuple):
    """The body at one instant, or its rates of change."""

    position_m: Float[jax.Array, " axis"]  # x, y (up) and, in space, z
    velocity_m_s: Float[jax.Array, " axis"]
    way_m: Float[jax.Array, ""]  # how far it has come along its curve


class FreeSystem(System):
    """One body that slides on nothing."""

    def __init__(self, task: Task):
        super().__init__(task)
        law, scene = self.law, self.scene
        self.upward = _upward(scene, jnp)
        self.floor = floor_of(task.effects, task.named, scene)
        tangent = _along(law, scene, jnp)
        self.rubbing = None
        if rubs(law, scene):
            self.rubbing = Rubbing(
                speed=lambda at: jnp.sum(at.velocity_m_s * tangent),
                acceleration=self._acceleration,
                stopped=lambda at: at._replace(velocity_m_s=jnp.zeros_like(at.velocity_m_s)),
                moved=self._slipped,
            )
        self.method = DORMAND_PRINCE if SPRING in scene.laws else CLASSICAL
        is_smooth = self.floor is None and self.rubbing is None
        self.most_events = 1 if is_smooth else MAX_BOUNCES
        velocity = start_velocity(task.effects, task.named, scene)
        self.start = Body(
            jnp.asarray(scene.start_m)[0] + law.start_m[0] * tangent,
            law.start_speed_m_s[0] * tangent if velocity is None else velocity[0],
            jnp.zeros(()),
        )

    def advance(self, state, time_s, left_s, is_last):
        """To the next bounce or turn; what bounces faster than the last rests."""
        body, floor = state, self.floor
        if self.rubbing is not None:
            return to_turn(body, time_s, left_s, is_last, self.rubbing)
        if floor is None:
            return self._moved(body, time_s, left_s, False), left_s
        rests = (body.position_m[1] <= floor.height_m) & (body.velocity_m_s[1] == 0)

        def level(at: Body, _: jax.Array) -> tuple[jax.Array, jax.Array]:
            return at.position_m[1] - floor.height_m, at.velocity_m_s[1]

        def bounced(at: Body, _: jax.Array) -> Body:
            falls = -at.velocity_m_s[1]
            rebound = jnp.where((falls > PLASTIC_M_S) & ~is_last, floor.restitution * falls, 0.0)
            return at._replace(
                position_m=jnp.where(self.upward, floor.height_m, at.position_m),
                velocity_m_s=jnp.where(self.upward, rebound, at.velocity_m_s * (1 - floor.grip)),
            )

        def after(spent_s: jax.Array) -> Body:
            return self._moved(body, time_s, spent_s, rests)

        found, spent_s = to_crossing(body, after, level, bounced, left_s, ~rests)
        return found, jnp.where(is_last, left_s, spent_s)

    def seen(self, states, times_s):
        """As they are."""
        return states.position_m.T[None], states.velocity_m_s.T[None]

    def _moved(self, body: Body, time_s: Any, spent_s: jax.Array, rests: Any) -> Body:
        """The body after a time without a bounce."""
        return runge_kutta(
            lambda at, t: rates(at, t, self.law, self.scene, rests),
            body,
            time_s,
            spent_s,
            self.method,
        )

    def _slipped(self, body: Body, time_s: Any, spent_s: jax.Array, way: Any) -> Body:
        """The body after a time in which it does not turn back."""
        return runge_kutta(
            lambda at, t: slip_rates(at, t, self.law, self.scene, way)[0],
            body,
            time_s,
            spent_s,
            self.method,
        )

    def _acceleration(self, at: Body, time_s: Any, way: Any) -> tuple[Any, Any]:
        changes, excess = slip_rates(at, time_s, self.law, self.scene, way)
        return jnp.sum(changes.velocity_m_s * _along(self.law, self.scene, jnp)), excess


def rubs(law: Dynamics, scene: Surroundings) -> bool:
    """Whether dry friction may act on what goes to and fro along a line."""
    return law.rubs and not scene.moves_in_plane


def start_velocity(
    effects: Sequence[Effect], theta: Mapping[str, Any], scene: Surroundings
) -> Any | None:
    """The velocity in the plane at the start, `[..., object, 2]`; None on a straight path."""
    return total([e.start_velocity(theta, scene) for e in effects])


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
    depth = (start[1] - floor.height_m) / magnified(effects, theta, scene, axis=1)
    return floor._replace(height_m=start[1] - xp.maximum(depth, xp.zeros_like(depth)))


def magnified(
    effects: Sequence[Effect], theta: Mapping[str, Any], scene: Surroundings, axis: int
) -> Any:
    """How many times as large as they are lengths are seen along an axis, from the start on."""
    xp = theta["m1"].__array_namespace__()
    ahead = [[0.0, 1.0 if other == axis else 0.0] for other in range(scene.num_axes)]
    ends = xp.asarray(scene.start_m)[:, :, None] + xp.asarray(ahead)
    for effect in effects:
        ends = effect.measure(ends, theta, scene)
    return ends[0, axis, 1] - ends[0, axis, 0]


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


def slip_rates(
    body: Body, time_s: Any, law: Dynamics, scene: Surroundings, way: Any
) -> tuple[Body, Any]:
    """How a body on a straight track changes, and by how much its pull exceeds what holds it.

    The latter over its inertia, m/s^2. `way`: 1 or -1, as it slips along the track; 0: not.
    """
    xp = body.position_m.__array_namespace__()
    tangent = _along(law, scene, xp)
    changes = rates(body, time_s, law, scene, xp.asarray(False))
    state = state_at(body.way_m[None], xp.sum(body.velocity_m_s * tangent)[None], time_s, scene)
    rub = (law.coefficient(state) * law.gravity * law.mass / law.inertia)[0]
    excess = abs(xp.sum(changes.velocity_m_s * tangent)) - rub
    return changes._replace(velocity_m_s=changes.velocity_m_s - way * rub * tangent), excess


def _along(law: Dynamics, scene: Surroundings, xp: Any) -> Any:
    """The direction of a straight path, `[axis]`; in the plane forward."""
    cos, sin = xp.cos(law.ramp_rad), xp.sin(law.ramp_rad)
    return xp.stack([cos, -sin, *[0.0 * cos] * (scene.num_axes - 2)])


def _upward(scene: Surroundings, xp: Any) -> Any:
    """Which axis is upward, `[axis]`."""
    return xp.asarray([axis == 1 for axis in range(scene.num_axes)])

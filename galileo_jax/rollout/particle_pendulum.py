"""A bob on a thread or a rod, on a circle, at any angle.

The angle's equation is integrated by Runge-Kutta steps of 1/480 s (error below 1e-9 of the
amplitude over 10 s of a thread of 1 m, 1e-6 of one of 5 cm). Dry friction in the bearing holds the
bob where it turns back, if it can; these instants are met at their time. A thread that gives way
follows its load at once, since it vibrates much faster than the bob swings (first order in the
stretch s):

    r = L + s (cos a + L w^2 / g)
    L a'' (1 + i + 2 (s / L) (cos a + 3 L w^2 / g)) = -g sin a (1 + (s / L) (cos a - L w^2 / g)) + f

i: inertia beyond the bob's, as a share; f: other forces along the circle, over the mass.

Source: Landau and Lifshitz, Mechanics (1976), section 5 (the Lagrangian, with its minimum over r).
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.rollout.events import Motion, System, Task, runge_kutta, to_crossing
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at, total

SUBSTEPS = 2
MAX_EVENTS = 4  # within one recorded step


class Pendulum(NamedTuple):
    """What the parameters make of a pendulum.

    Attributes:
      law: the forces along its circle.
      length_m: without load.
      stretch_m: by its weight at rest.
      has_friction: whether the bearing rubs.
    """

    law: Dynamics
    length_m: Any
    stretch_m: Any
    has_friction: bool


class Swing(NamedTuple):
    """The bob at one instant, or its rates: angle from the picture's vertical, rad; rad/s."""

    angle_rad: Any
    turning_rad_s: Any


def make_pendulum(
    effects: Sequence[Effect],
    theta: Mapping[str, Any],
    scene: Surroundings,
    xp: Any,
    acts: Any = None,
) -> Pendulum:
    """Puts parameters (numbers) and effects together."""
    length = theta[LENGTH]
    stretch = total([0.0 * length, *(e.stretch(theta, scene) for e in effects)])
    rubs = any(e.friction(theta, scene) is not None for e in effects)
    law = dynamics(effects, scene, theta, xp, acts)
    return Pendulum(law, length, stretch, rubs)


def start(theta: Mapping[str, Any], pendulum: Pendulum) -> Swing:
    """Where the bob is at first, and how fast."""
    return Swing(theta[ANGLE], pendulum.law.start_speed_m_s[0] / pendulum.length_m)


def rates(
    swing: Swing, time_s: Any, way: Any, pendulum: Pendulum, scene: Surroundings
) -> tuple[Swing, Any]:
    """How a swing changes, and the least force over the mass that would hold it, m/s^2.

    Args:
      swing: the bob.
      time_s: since the start.
      way: which way it slips in the bearing: 1, -1, or 0 without friction.
      pendulum: its forces.
      scene: where it is.
    """
    law, length = pendulum.law, pendulum.length_m
    xp = length.__array_namespace__()
    angle, turning = swing.angle_rad - law.ramp_rad, swing.turning_rad_s
    sin, cos = xp.sin(angle), xp.cos(angle)
    state = state_at((length * angle)[None], (length * turning)[None], time_s, scene)
    share, outward = pendulum.stretch_m / length, length * turning**2
    pull = -sin * (law.gravity + share * (law.gravity * cos - outward))
    pull = pull + (law.drive(state) / law.mass)[0]
    rub = law.coefficient(state)[0] * abs(law.gravity * cos + outward)
    inertia = (law.inertia / law.mass)[0] + 2 * share * (cos + 3 * outward / law.gravity)
    return Swing(turning, (pull - way * rub) / (length * inertia)), abs(pull) - rub


def place(swing: Swing, turns: Any, pendulum: Pendulum, first: Swing, scene: Surroundings) -> Any:
    """Centres and velocities, `[2]` each; `turns`: the angular acceleration, rad/s^2."""
    law, length = pendulum.law, pendulum.length_m
    xp = length.__array_namespace__()

    def radius(at: Swing) -> Any:
        load = xp.cos(at.angle_rad - law.ramp_rad) + length * at.turning_rad_s**2 / law.gravity
        return length + pendulum.stretch_m * load

    def outward(at: Swing) -> Any:
        return xp.stack([xp.sin(at.angle_rad), -xp.cos(at.angle_rad)])

    pivot = xp.asarray(scene.start_m)[0, :2] - radius(first) * outward(first)
    away = outward(swing)
    along = xp.stack([-away[1], away[0]])
    loads = 2 * length * turns / law.gravity - xp.sin(swing.angle_rad - law.ramp_rad)
    grows = pendulum.stretch_m * swing.turning_rad_s * loads
    speed = radius(swing) * swing.turning_rad_s
    return pivot + radius(swing) * away, speed * along + grows * away


def pendulum_system(task: Task) -> System:
    """A bob on a circle."""
    scene = task.scene
    pendulum = make_pendulum(task.effects, task.named, scene, jnp, task.acts)
    first = start(task.named, pendulum)

    def advance(swing: Swing, time_s: jax.Array, left_s: jax.Array, is_last: Any):
        if not pendulum.has_friction:
            return _moved(swing, time_s, left_s, 0.0, pendulum, scene), left_s
        return _to_turn(swing, time_s, left_s, is_last, pendulum, scene)

    def seen(swings: Swing, times_s: jax.Array) -> Motion:
        def one(swing: Swing, time_s: jax.Array) -> tuple[jax.Array, jax.Array]:
            way = jnp.sign(swing.turning_rad_s) if pendulum.has_friction else 0.0
            turns = rates(swing, time_s, way, pendulum, scene)[0].turning_rad_s
            return place(swing, turns, pendulum, first, scene)

        position, velocity = jax.vmap(one)(swings, times_s)
        return position.T[None], velocity.T[None]

    return System(first, advance, MAX_EVENTS if pendulum.has_friction else 1, seen)


def _to_turn(
    swing: Swing,
    time_s: jax.Array,
    left_s: jax.Array,
    is_last: jax.Array,
    pendulum: Pendulum,
    scene: Surroundings,
) -> tuple[Swing, jax.Array]:
    """Moves on to where it turns back, or by `left_s`; returns the bob and the time it took."""
    pulled, excess = rates(swing, time_s, 0.0, pendulum, scene)
    starts = jnp.where(excess > 0, jnp.sign(pulled.turning_rad_s), 0.0)
    way = jnp.where(swing.turning_rad_s == 0, starts, jnp.sign(swing.turning_rad_s))

    def level(at: Swing, spent_s: jax.Array) -> tuple[jax.Array, jax.Array]:
        speeds_up = rates(at, time_s + spent_s, way, pendulum, scene)[0].turning_rad_s
        return at.turning_rad_s * way, speeds_up * way

    def turned(at: Swing, _: jax.Array) -> Swing:
        return at._replace(turning_rad_s=jnp.zeros_like(at.turning_rad_s))

    def after(spent_s: jax.Array) -> Swing:
        return _moved(swing, time_s, spent_s, way, pendulum, scene)

    found, spent_s = to_crossing(swing, after, level, turned, left_s, way != 0)
    found = jax.tree.map(lambda one, other: jnp.where(way == 0, one, other), swing, found)
    return found, jnp.where(is_last, left_s, spent_s)


def _moved(
    swing: Swing,
    time_s: jax.Array,
    spent_s: jax.Array,
    way: Any,
    pendulum: Pendulum,
    scene: Surroundings,
) -> Swing:
    """The bob after a time in which it does not turn back."""
    step_s = spent_s / SUBSTEPS

    def rate(at: Swing, t: jax.Array) -> Swing:
        return rates(at, t, way, pendulum, scene)[0]

    def substep(index: Any, at: Swing) -> Swing:
        return runge_kutta(rate, at, time_s + index * step_s, step_s)

    return jax.lax.fori_loop(0, SUBSTEPS, substep, swing)

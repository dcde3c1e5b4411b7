"""The rigid engine on a circle: a bob on a thread or a rod, at any angle.

The angle's equation is integrated by Runge-Kutta steps of 1/480 s (error below 1e-9 of the
amplitude over 10 s of a thread of 1 m, 1e-6 of one of 5 cm). Dry friction in the bearing holds the
bob where it turns back, if it can; these instants are met at their time, as in `engine_free`. A
thread that gives way follows its load at once, since it vibrates much faster than the bob swings
(first order in the stretch s):

    r = L + s (cos a + L w^2 / g)
    L a'' (1 + i + 2 (s / L) (cos a + 3 L w^2 / g)) = -g sin a (1 + (s / L) (cos a - L w^2 / g)) + f

i: inertia beyond the bob's, as a share; f: other forces along the circle, over the mass.

Source: Landau and Lifshitz, Mechanics (1976), section 5 (the Lagrangian, with its minimum over r).
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.event_loop import recorded, step_by_events
from galileo_jax.rollout.motion import Dynamics, dynamics, state_at
from galileo_jax.runtime.errors import InputError

SUBSTEPS = 2
MAX_EVENTS = 4  # within one recorded step
NEWTON_STEPS = 3


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
    given = [s for e in effects if (s := e.stretch(theta, scene)) is not None]
    rubs = any(e.friction(theta, scene) is not None for e in effects)
    law = dynamics(effects, scene, theta, xp, acts)
    return Pendulum(law, length, sum(given, 0.0 * length), rubs)


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


def roll_out(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
    acts: jax.Array | None = None,
) -> tuple[Float[jax.Array, "object 2 record"], Float[jax.Array, "object 2 record"]]:
    """One rollout: `[parameter]` to centres and velocities, each `[object, 2, record]`.

    Of records beyond the first `count` the centres are as in the last of these.
    """
    named = {name: theta[i] for i, name in enumerate(names)}
    pendulum = make_pendulum(effects, named, scene, jnp, acts)
    first = start(named, pendulum)

    def step(swing: Swing, index: jax.Array) -> Swing:
        return _step(swing, index * dt_s, dt_s, pendulum, scene)

    def seen(swing: Swing, index: jax.Array):
        way = jnp.sign(swing.turning_rad_s) if pendulum.has_friction else 0.0
        turns = rates(swing, index * dt_s, way, pendulum, scene)[0].turning_rad_s
        return place(swing, turns, pendulum, first, scene)

    swings = recorded(step, first, num_records, count)
    position, velocity = jax.vmap(seen)(swings, jnp.arange(num_records))
    return position.T[None], velocity.T[None]


def _step(
    swing: Swing, time_s: jax.Array, dt_s: float, pendulum: Pendulum, scene: Surroundings
) -> Swing:
    """One recorded step, from one turning back to the next."""
    if not pendulum.has_friction:
        return _integrated(swing, time_s, jnp.asarray(dt_s), 0.0, pendulum, scene)

    def advance(swing: Swing, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_turn(swing, time_s, left_s, is_last, pendulum, scene)

    return step_by_events(advance, swing, time_s, dt_s, MAX_EVENTS)


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

    def after(spent_s: jax.Array) -> Swing:
        return _integrated(swing, time_s, spent_s, way, pendulum, scene)

    whole = after(left_s)
    turns = whole.turning_rad_s * way < 0
    begin, end = (
        rates(at, t, way, pendulum, scene)[0].turning_rad_s
        for at, t in ((swing, time_s), (whole, time_s + left_s))
    )
    at = _zero(swing.turning_rad_s, whole.turning_rad_s, begin * left_s, end * left_s, turns)
    at = jnp.where(turns, at * left_s, left_s)
    turned = Swing(after(at).angle_rad, jnp.zeros_like(at))
    found = jax.tree.map(lambda one, other: jnp.where(turns, one, other), turned, whole)
    found = jax.tree.map(lambda one, other: jnp.where(way == 0, one, other), swing, found)
    return found, jnp.where(is_last, left_s, at)


def _zero(first: Any, last: Any, rise: Any, rise_at_last: Any, is_there: Any) -> jax.Array:
    """Where in [0, 1] the cubic with these values and slopes at its ends is zero; else anything.

    A step is a hundredth of a swing: the cubic is off by less than 1e-7 of the turning.
    """
    bend, twist = 3 * (last - first) - 2 * rise - rise_at_last, 2 * (first - last) + rise
    twist = twist + rise_at_last
    at = jnp.clip(-first / jnp.where(is_there, last - first, 1.0), 0.0, 1.0)
    for _ in range(NEWTON_STEPS):
        # The last of the steps carries the derivative of the instant.
        at = jax.lax.stop_gradient(at)
        value = first + at * (rise + at * (bend + at * twist))
        slope = jax.lax.stop_gradient(rise + at * (2 * bend + 3 * at * twist))
        at = jnp.clip(at - value / jnp.where(is_there, slope, 1.0), 0.0, 1.0)
    return at


def _integrated(
    swing: Swing,
    time_s: jax.Array,
    spent_s: jax.Array,
    way: Any,
    pendulum: Pendulum,
    scene: Surroundings,
) -> Swing:
    h = spent_s / SUBSTEPS

    def rate(at: Swing, t: jax.Array) -> Swing:
        return rates(at, t, way, pendulum, scene)[0]

    def moved(at: Swing, by: Swing, h: Any) -> Swing:
        return Swing(*(value + h * change for value, change in zip(at, by, strict=True)))

    def substep(index: Any, at: Swing) -> Swing:
        t = time_s + index * h
        first = rate(at, t)
        second = rate(moved(at, first, 0.5 * h), t + 0.5 * h)
        third = rate(moved(at, second, 0.5 * h), t + 0.5 * h)
        fourth = rate(moved(at, third, h), t + h)
        four = zip(first, second, third, fourth, strict=True)
        return moved(at, Swing(*((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in four)), h)

    return jax.lax.fori_loop(0, SUBSTEPS, substep, swing)


class EnginePendulum(EngineJax):
    """A bob on a circle, see the module."""

    roll_out = staticmethod(roll_out)

    def __init__(self, model: Model, laws: ActingLaws | None = None):
        """Raises `InputError` for a track in space."""
        if model.scene.surroundings.num_axes != 2:
            raise InputError(
                "scenario pendulum: a track in the plane (x, y) expected, not in space"
            )
        super().__init__(model, laws)

"""A bob on a thread or a rod, on a circle, at any angle.

The angle's equation is integrated by Runge-Kutta steps of fifth order and 1/240 s or, of a slow
swing, 1/150 of its period at most (error below 1e-9 of the amplitude over 10 s, 3e-7 of a thread of
5 cm). Dry friction in the bearing holds the bob where it turns back, if it can; these instants are
met at their time. A thread that gives way follows its load at once, since it vibrates much faster
than the bob swings (first order in the stretch s):

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
from galileo_jax.rollout.events import DORMAND_PRINCE, Rubbing, System, Task, runge_kutta, to_turn
from galileo_jax.rollout.motion import Dynamics, state_at, total

MAX_EVENTS = 4  # within one recorded step


class Swing(NamedTuple):
    """The bob at one instant, or its rates: angle from the picture's vertical, rad; rad/s."""

    angle_rad: Any
    turning_rad_s: Any


class Pendulum(NamedTuple):
    """What the parameters make of a pendulum."""

    law: Dynamics  # the forces along its circle
    length_m: Any  # without load
    stretch_m: Any  # by its weight at rest
    first: Swing  # the bob at the start
    scene: Surroundings  # where it is

    def rates(self, swing: Swing, time_s: Any, way: Any) -> tuple[Swing, Any]:
        """How a swing changes, and the least force over the mass that would hold it, m/s^2.

        `way`: which way the bob slips in the bearing: 1, -1, or 0 without friction.
        """
        law, length = self.law, self.length_m
        xp = length.__array_namespace__()
        angle, turning = swing.angle_rad - law.ramp_rad, swing.turning_rad_s
        sin, cos = xp.sin(angle), xp.cos(angle)
        state = state_at((length * angle)[None], (length * turning)[None], time_s, self.scene)
        share, outward = self.stretch_m / length, length * turning**2
        pull = -sin * (law.gravity + share * (law.gravity * cos - outward))
        pull = pull + (law.drive(state) / law.mass)[0]
        rub = law.coefficient(state)[0] * abs(law.gravity * cos + outward)
        inertia = (law.inertia / law.mass)[0] + 2 * share * (cos + 3 * outward / law.gravity)
        return Swing(turning, (pull - way * rub) / (length * inertia)), abs(pull) - rub

    def place(self, swing: Swing, turns: Any) -> Any:
        """Centres and velocities, `[2]` each; `turns`: the angular acceleration, rad/s^2."""
        law, length = self.law, self.length_m
        xp = length.__array_namespace__()

        def radius(at: Swing) -> Any:
            load = xp.cos(at.angle_rad - law.ramp_rad) + length * at.turning_rad_s**2 / law.gravity
            return length + self.stretch_m * load

        def outward(at: Swing) -> Any:
            return xp.stack([xp.sin(at.angle_rad), -xp.cos(at.angle_rad)])

        pivot = xp.asarray(self.scene.start_m)[0, :2] - radius(self.first) * outward(self.first)
        away = outward(swing)
        along = xp.stack([-away[1], away[0]])
        loads = 2 * length * turns / law.gravity - xp.sin(swing.angle_rad - law.ramp_rad)
        grows = self.stretch_m * swing.turning_rad_s * loads
        speed = radius(swing) * swing.turning_rad_s
        return pivot + radius(swing) * away, speed * along + grows * away


def make_pendulum(
    effects: Sequence[Effect],
    theta: Mapping[str, Any],
    scene: Surroundings,
    law: Dynamics,
) -> Pendulum:
    """Puts parameters (numbers) and effects together."""
    length = theta[LENGTH]
    stretch = total([0.0 * length, *(e.stretch(theta, scene) for e in effects)])
    first = Swing(theta[ANGLE], law.start_speed_m_s[0] / length)
    return Pendulum(law, length, stretch, first, scene)


class PendulumSystem(System):
    """A bob on a circle."""

    def __init__(self, task: Task):
        super().__init__(task)
        self.pendulum = make_pendulum(task.effects, task.named, task.scene, self.law)
        self.most_events = MAX_EVENTS if self.law.rubs else 1
        self.start = self.pendulum.first
        self.rubbing = Rubbing(
            speed=lambda at: at.turning_rad_s,
            acceleration=self._acceleration,
            stopped=lambda at: at._replace(turning_rad_s=jnp.zeros_like(at.turning_rad_s)),
            moved=self._moved,
        )

    def advance(self, state, time_s, left_s, is_last):
        """To where it turns back; at any time where nothing rubs."""
        if not self.law.rubs:
            return self._moved(state, time_s, left_s, 0.0), left_s
        return to_turn(state, time_s, left_s, is_last, self.rubbing)

    def seen(self, states, times_s):
        """From the angle to x and y."""

        def one(swing: Swing, time_s: jax.Array) -> tuple[jax.Array, jax.Array]:
            way = jnp.sign(swing.turning_rad_s) if self.law.rubs else 0.0
            turns = self.pendulum.rates(swing, time_s, way)[0].turning_rad_s
            return self.pendulum.place(swing, turns)

        position, velocity = jax.vmap(one)(states, times_s)
        return position.T[None], velocity.T[None]

    def _acceleration(self, at: Swing, time_s: Any, way: Any) -> tuple[Any, Any]:
        rates, excess = self.pendulum.rates(at, time_s, way)
        return rates.turning_rad_s, excess

    def _moved(self, swing: Swing, time_s: jax.Array, spent_s: jax.Array, way: Any) -> Swing:
        """The bob after a time in which it does not turn back."""
        return runge_kutta(
            lambda at, t: self.pendulum.rates(at, t, way)[0], swing, time_s, spent_s, DORMAND_PRINCE
        )

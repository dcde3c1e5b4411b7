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

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.events import (
    PART,
    PLASTIC_M_S,
    Motion,
    System,
    Task,
    of_task,
    reaches_s,
    step_by_events,
)
from galileo_jax.rollout.motion import PerObject, state_at, to_plane
from galileo_jax.rollout.path_bodies import (
    Accelerations,
    Bodies,
    Forces,
    Links,
    Number,
    Numbers,
    apart,
    in_groups,
    of_group,
)

TOUCH_M, TOUCH_M_S = 1e-9, 1e-9
PAST_FOOT_M = 1e-12


class Events(NamedTuple):
    """When each comes, s from now: ends of slipping, arrivals at the foot, hits of neighbours."""

    grip: list[Number]
    foot: list[Number]
    hit: list[Number]
    soonest: Number


class PathSystem(System):
    """Bodies on their path."""

    def __init__(self, task: Task):
        super().__init__(task)
        law, scene = self.law, self.scene
        self.count, self.dt_s = len(scene.names), task.dt_s
        self.rolls = scene.rolls or (False,) * self.count
        speed = tuple(law.start_speed_m_s[i] for i in range(self.count))
        # What is pushed rolls from the hand.
        rim = tuple(
            v if rolls else jnp.zeros_like(v) for v, rolls in zip(speed, self.rolls, strict=True)
        )
        self.start = Bodies(tuple(law.start_m[i] for i in range(self.count)), speed, rim)
        self.part = self._exact_part if law.is_steady else None

    def advance(self, state, time_s, left_s, is_last):
        """To the foot, a hit, or an end of slipping."""
        return self._to_next_event(state, time_s, left_s, is_last)[:2]

    def seen(self, states, times_s):
        """From the path to x and y."""
        path, speed = (jnp.stack(own, axis=-1) for own in (states.path_m, states.speed_m_s))
        slopes = self.law.ramp_rad, self.law.table_rad
        position, velocity = to_plane(path, speed, *slopes, self.scene)
        return jnp.moveaxis(position, 0, -1), jnp.moveaxis(velocity, 0, -1)

    def _exact_part(self, bodies: Bodies, first: jax.Array) -> tuple[Bodies, Bodies]:
        """As of `System.part`: between events accelerations are constant."""
        whole_s = PART * self.dt_s
        since_s = jnp.arange(PART) * self.dt_s

        def advance(
            carry: tuple[Bodies, Bodies], time_s: jax.Array, left_s: jax.Array, is_last: jax.Array
        ):
            bodies, seen = carry
            after, t, a = self._to_next_event(bodies, time_s, left_s, is_last)
            passed = since_s - (whole_s - left_s)  # since this phase began
            moved = bodies.after(a, passed)
            seen = jax.tree.map(lambda new, old: jnp.where(passed >= 0, new, old), moved, seen)
            return (after, seen), t

        unseen = jax.tree.map(lambda number: jnp.broadcast_to(number, since_s.shape), bodies)
        most = PART * self.most_events
        return step_by_events(advance, (bodies, unseen), first * self.dt_s, whole_s, most)

    def _to_next_event(
        self, bodies: Bodies, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array
    ) -> tuple[Bodies, jax.Array, Accelerations]:
        """Moves on to the next event, or by `left_s`; returns bodies, the time it took, and how.

        When `is_last`, by `left_s` in any case: where events never end (an object in a corner from
        which both sides lead up) what is slow waits, and the others go on.
        """
        touches = self._touches(bodies)
        a = self._accelerations(bodies, bodies, touches, time_s)
        events = self._event_times(bodies, touches, a, left_s)
        if not self.law.is_steady:
            half = 0.5 * events.soonest
            a = self._accelerations(bodies, bodies.after(a, half), touches, time_s + half)
            events = self._event_times(bodies, touches, a, left_s)
        t = jnp.where(is_last, left_s, events.soonest)
        q, v, u = (list(numbers) for numbers in bodies.after(a, t))
        for i, rolls in enumerate(self.rolls):
            holds = events.grip[i] <= t
            if rolls:
                u[i] = jnp.where(holds, v[i], u[i])
            else:
                v[i] = jnp.where(holds, 0.0, v[i])
        if self.scene.has_table:
            arrives = [foot <= t for foot in events.foot]
            v, u = self._past_foot(v, u, arrives, time_s + t)
            edge = [jnp.where(one < 0, -PAST_FOOT_M, 0.0) for one in v]
            q = [jnp.where(*of) for of in zip(arrives, edge, q, strict=True)]
        if self.count > 1:
            met = Bodies(tuple(q), tuple(v), tuple(u))
            v = self._after_hits(met, [hit <= t for hit in events.hit])
        for i, before in enumerate(bodies.speed_m_s):
            waits = is_last & (t > events.soonest) & (jnp.abs(before) < PLASTIC_M_S)
            q[i] = jnp.where(waits, bodies.path_m[i], q[i])
            v[i] = jnp.where(waits, 0.0, v[i])
            u[i] = jnp.where(waits, 0.0, u[i]) if self.rolls[i] else u[i]
        return Bodies(tuple(q), tuple(v), tuple(u)), t, a

    def _gaps_m(self, bodies: Bodies) -> Numbers:
        """Between the faces of neighbours; below 0 where these knock as soon as they approach."""
        law, scene = self.law, self.scene

        def between(i: int) -> Number:
            x = [bodies.path_m[j] + scene.corner_m[j] for j in (i, i + 1)]
            apart = x[1] - x[0] - scene.half_length_m[i + 1] - scene.half_length_m[i]
            # What stands in the way is past its start, or about to be, once it was hit.
            past_m = bodies.path_m[i + 1] - law.start_m[i + 1]
            hit = (past_m > TOUCH_M) | ((past_m > -TOUCH_M) & (bodies.speed_m_s[i + 1] > 0))
            return apart - jnp.where(hit, law.overlap_m, 0.0)

        return tuple(between(i) for i in range(self.count - 1))

    def _touches(self, bodies: Bodies) -> Links:
        """Whether neighbours rest against each other or move as one."""
        v = bodies.speed_m_s
        return tuple(
            (gap < TOUCH_M) & (jnp.abs(v[i + 1] - v[i]) < TOUCH_M_S)
            for i, gap in enumerate(self._gaps_m(bodies))
        )

    def _accelerations(
        self, bodies: Bodies, at: Bodies, touches: Links, time_s: jax.Array
    ) -> Accelerations:
        """Accelerations, with the forces that act `at` a place and speed."""
        law, objects = self.law, range(self.count)
        path = jnp.stack(at.path_m)

        def of(act, speeds: Numbers) -> PerObject:
            return act(state_at(path, jnp.stack(speeds), time_s, self.scene))

        drive, brake = of(law.drive, at.speed_m_s), of(law.brake, at.slip_m_s)
        direction = [jnp.sign(slip) for slip in bodies.slip_m_s]
        forces = Forces(
            tuple(drive[i] - direction[i] * brake[i] for i in objects),
            tuple(brake[i] for i in objects),
            tuple(one == 0 for one in direction),
            tuple(law.inertia[i] for i in objects),
            {i: 1 / law.rim[i] for i in objects if self.rolls[i]},
        )
        a, slips = in_groups(forces.move, forces.move(apart(self.count)), touches)
        rim = [jnp.zeros_like(one) for one in a]
        for i in forces.turning:
            turned = (direction[i] + slips[i]) * brake[i] * law.rim[i]
            rim[i] = jnp.where(forces.sticks[i] & (slips[i] == 0), a[i], turned)
        return Accelerations(a, tuple(rim))

    def _event_times(
        self, bodies: Bodies, touches: Links, by: Accelerations, left_s: jax.Array
    ) -> Events:
        """When each event comes at constant accelerations, s; inf where it does not."""
        grip, foot, hit = [], [], []
        q, v, a = bodies.path_m, bodies.speed_m_s, by.centre
        for i, slip in enumerate(bodies.slip_m_s):
            change = a[i] - by.rim[i] if self.rolls[i] else a[i]
            ends = slip * change < 0
            grip.append(jnp.where(ends, -slip / jnp.where(ends, change, 1.0), jnp.inf))
            if self.scene.has_table:
                toward = jnp.where(q[i] < 0, 1.0, -1.0)
                far = jnp.abs(q[i])
                comes = reaches_s(far, toward * v[i], toward * a[i])
                foot.append(jnp.where(far > PAST_FOOT_M, comes, jnp.inf))
        for i, gap in enumerate(self._gaps_m(bodies)):
            meets = reaches_s(gap, v[i] - v[i + 1], a[i] - a[i + 1])
            hit.append(jnp.where(touches[i], jnp.inf, meets))
        soonest = functools.reduce(jnp.minimum, (*grip, *foot, *hit), left_s)
        return Events(grip, foot, hit, soonest)

    def _past_foot(
        self, v: list[Number], u: list[Number], arrives: list[jax.Array], time_s: jax.Array
    ) -> tuple[list[Number], list[Number]]:
        """Speeds of centres and rims after the impulse that turns those that arrive at the foot.

        Its friction is k times as large, or what ends the slip.
        """
        law, (cos, sin) = self.law, self.law.turn
        slips = jnp.stack([one - rim for one, rim in zip(v, u, strict=True)])
        k = law.coefficient(state_at(jnp.zeros_like(slips), slips, time_s, self.scene))
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
            rims.append(jnp.where(arrives[i], turned * law.foot, rim) if self.rolls[i] else rim)
        return speeds, rims

    def _after_hits(self, bodies: Bodies, hits: list[jax.Array]) -> list[Number]:
        """Speeds after the neighbours that `hits` names knock together.

        Impulses only push, and neighbours part at least e times as fast as they met: of all such
        speeds the nearest in kinetic energy, found by merging as in `_accelerations`. So what
        stands against a body that is hit is pushed on at once. Faces are smooth: rims keep their
        speeds.
        """
        v = bodies.speed_m_s
        ahead, meets = [jnp.zeros_like(v[0])], []
        for i, gap in enumerate(self._gaps_m(bodies)):
            meets.append(hits[i] | (gap < TOUCH_M))
            approach = v[i] - v[i + 1]
            e = jnp.where(approach > PLASTIC_M_S, self.law.restitution, 0.0)
            ahead.append(ahead[-1] + jnp.where(meets[i], e * approach, 0.0))
        inertia = [self.law.at_hits[i] for i in range(self.count)]
        behind = tuple(w - more for w, more in zip(v, ahead, strict=True))
        momentum = [m * w for m, w in zip(inertia, behind, strict=True)]

        def together(links: Links) -> tuple[Numbers, None]:
            both = zip(of_group(momentum, links), of_group(inertia, links), strict=True)
            return tuple(p / m for p, m in both), None

        common, _ = in_groups(together, (behind, None), tuple(meets))
        any_hits = functools.reduce(jnp.logical_or, hits)
        return [jnp.where(any_hits, common[i] + ahead[i], v[i]) for i in range(self.count)]


@of_task
def roll_out(task: Task) -> Motion:
    """Bodies on their path."""
    return task.motion(PathSystem(task))


class EnginePath(EngineJax):
    """Bodies on their path, see the module."""

    roll_out = staticmethod(roll_out)

"""Between events: what accelerates bodies, where that takes them, and when the next event is."""

import functools
from typing import NamedTuple

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.rollout.events import reaches_s
from galileo_jax.rollout.motion import Dynamics
from galileo_jax.rollout.path_bodies import (
    Bodies,
    Links,
    Number,
    Numbers,
    apart,
    of_group,
    rolls,
    with_link,
)

PAST_FOOT_M = 1e-12


class Accelerations(NamedTuple):
    """Of centres and rims, m/s^2."""

    centre: Numbers
    rim: Numbers


def moved_on(bodies: Bodies, a: Accelerations, t: jax.Array) -> Bodies:
    """The bodies after a time `t` of constant accelerations."""
    q, v, u = bodies
    return Bodies(
        tuple(q + v * t + 0.5 * a * t**2 for q, v, a in zip(q, v, a.centre, strict=True)),
        tuple(v + a * t for v, a in zip(v, a.centre, strict=True)),
        tuple(u + a * t for u, a in zip(u, a.rim, strict=True)),
    )


def accelerations(
    bodies: Bodies,
    at: Bodies,
    touches: Links,
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> Accelerations:
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
    forces = _Forces(
        [drive[i] - direction[i] * brake[i] for i in range(count)],
        [brake[i] for i in range(count)],
        [one == 0 for one in direction],
        [law.inertia[i] for i in range(count)],
        {i: 1 / law.rim[i] for i in range(count) if rolls(scene, i)},
    )
    links = apart(count)
    a, slips = forces.move(links)
    for _ in range(count - 1):
        for i in range(count - 1):
            links = with_link(links, i, touches[i] & (a[i] > a[i + 1]))
            a, slips = forces.move(links)
    rim = [jnp.zeros_like(one) for one in a]
    for i in forces.turning:
        turned = (direction[i] + slips[i]) * brake[i] * law.rim[i]
        rim[i] = jnp.where(forces.sticks[i] & (slips[i] == 0), a[i], turned)
    return Accelerations(tuple(a), tuple(rim))


class _Forces(NamedTuple):
    """What acts on each body: pull and brake, N; whether it sticks; kg; what rolling adds, kg."""

    pull: list[Number]
    brake: list[Number]
    sticks: list[jax.Array]
    inertia: list[Number]
    turning: dict[int, Number]

    def move(self, links: Links) -> tuple[list[Number], dict[int, Number]]:
        """Accelerations of groups, and the way those that should roll slip all the same."""
        pull, brake, sticks, inertia, turning = self
        objects = range(len(pull))
        rest = [
            jnp.zeros_like(pull[i]) if i in turning else jnp.where(sticks[i], brake[i], 0.0)
            for i in objects
        ]
        pulls, holds = of_group(pull, links), of_group(rest, links)
        left = [
            force - jnp.clip(force, -held, held) for force, held in zip(pulls, holds, strict=True)
        ]
        masses = of_group(inertia, links)
        slips = {i: jnp.zeros_like(pull[i]) for i in turning}

        def with_grip() -> list[Number]:
            rubs, turns = ([jnp.zeros_like(one) for one in pull] for _ in range(2))
            for i, slip in slips.items():
                rubs[i] = slip * brake[i]
                turns[i] = jnp.where(sticks[i] & (slip == 0), turning[i], 0.0)
            rubbed, turned = of_group(rubs, links), of_group(turns, links)
            return [(left[i] - rubbed[i]) / (masses[i] + turned[i]) for i in objects]

        if not turning:
            return [force / mass for force, mass in zip(left, masses, strict=True)], slips
        a = with_grip()
        for _ in turning:
            for i in turning:
                fails = sticks[i] & (jnp.abs(a[i]) * turning[i] > brake[i])
                slips[i] = jnp.where(fails, jnp.sign(left[i]), slips[i])
            a = with_grip()
        return a, slips


class Events(NamedTuple):
    """When each comes, s from now: ends of slipping, arrivals at the foot, hits of neighbours."""

    grip: Numbers
    foot: Numbers
    hit: Numbers
    soonest: jax.Array


def event_times(
    bodies: Bodies,
    touches: Links,
    by: Accelerations,
    left_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> Events:
    """When each event comes at constant accelerations, s; inf where it does not."""
    grip, foot, hit = [], [], []
    q, v, a = bodies.path_m, bodies.speed_m_s, by.centre
    for i, slip in enumerate(bodies.slip_m_s):
        change = a[i] - by.rim[i] if rolls(scene, i) else a[i]
        ends = slip * change < 0
        grip.append(jnp.where(ends, -slip / jnp.where(ends, change, 1.0), jnp.inf))
        if scene.has_table:
            toward = jnp.where(q[i] < 0, 1.0, -1.0)
            far = jnp.abs(q[i])
            comes = reaches_s(far, toward * v[i], toward * a[i])
            foot.append(jnp.where(far > PAST_FOOT_M, comes, jnp.inf))
    for i, gap in enumerate(bodies.gap_m(law, scene)):
        meets = reaches_s(gap, v[i] - v[i + 1], a[i] - a[i + 1])
        hit.append(jnp.where(touches[i], jnp.inf, meets))
    soonest = functools.reduce(jnp.minimum, (*grip, *foot, *hit), left_s)
    return Events(tuple(grip), tuple(foot), tuple(hit), soonest)

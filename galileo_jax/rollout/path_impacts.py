"""Impulses: what the foot and a hit do to speeds."""

import functools

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.rollout.events import PLASTIC_M_S
from galileo_jax.rollout.motion import Dynamics, state_at
from galileo_jax.rollout.path_bodies import (
    TOUCH_M,
    Bodies,
    Number,
    apart,
    of_group,
    rolls,
    with_link,
)


def past_foot(
    v: list[Number],
    u: list[Number],
    arrives: list[jax.Array],
    time_s: jax.Array,
    law: Dynamics,
    scene: Surroundings,
) -> tuple[list[Number], list[Number]]:
    """Speeds of centres and rims after the impulse that turns those that arrive at the foot.

    Its friction is k times as large, or what ends the slip.
    """
    cos, sin = law.turn
    slips = jnp.stack([one - rim for one, rim in zip(v, u, strict=True)])
    k = law.coefficient(state_at(jnp.zeros_like(slips), slips, time_s, scene))
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
        rims.append(jnp.where(arrives[i], turned * law.foot, rim) if rolls(scene, i) else rim)
    return speeds, rims


def after_hits(
    bodies: Bodies, hits: list[jax.Array], law: Dynamics, scene: Surroundings
) -> list[Number]:
    """Speeds after the neighbours that `hits` names knock together.

    Impulses only push, and neighbours part at least e times as fast as they met: of all such
    speeds the nearest in kinetic energy, found by merging as in `accelerations`. So what stands
    against a body that is hit is pushed on at once. Faces are smooth: rims keep their speeds.
    """
    v = bodies.speed_m_s
    count = len(v)
    ahead, meets = [jnp.zeros_like(v[0])], []
    for i, gap in enumerate(bodies.gap_m(law, scene)):
        meets.append(hits[i] | (gap < TOUCH_M))
        approach = v[i] - v[i + 1]
        e = jnp.where(approach > PLASTIC_M_S, law.restitution, 0.0)
        ahead.append(ahead[-1] + jnp.where(meets[i], e * approach, 0.0))
    inertia = [law.at_hits[i] for i in range(count)]
    behind = [v[i] - ahead[i] for i in range(count)]
    links, common = apart(count), behind
    for _ in range(count - 1):
        for i in range(count - 1):
            links = with_link(links, i, meets[i] & (common[i] > common[i + 1]))
            momentum = of_group([m * w for m, w in zip(inertia, behind, strict=True)], links)
            masses = of_group(inertia, links)
            common = [p / m for p, m in zip(momentum, masses, strict=True)]
    any_hits = functools.reduce(jnp.logical_or, hits)
    return [jnp.where(any_hits, common[i] + ahead[i], v[i]) for i in range(count)]

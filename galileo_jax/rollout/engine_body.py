"""The body engine: a convex body that is thrown onto a plane, from impact to impact, in JAX.

Impacts at corners are met at their time, whatever the steps; between them bodies move by Moreau's
step. The motion is a continuous function of start and parameters, with JAX's derivatives, as long
as the order of the impacts stays the same. MuJoCo is the check: tests/rollout/test_engine_body.py.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.rollout.body import (
    Contacts,
    Masses,
    Pose,
    Solid,
    climbs_m_s,
    gaps_m,
    least_rises_m_s,
    levers_m,
    stepped,
    struck,
)
from galileo_jax.rollout.box_impulses import Corners
from galileo_jax.rollout.events import PLASTIC_M_S, step_by_events, to_crossing

MOST_CONTACTS = 4  # the lowest corners: of a box no more can touch
MAX_EVENTS = 8  # within one step
NEAR_M = 1e-3  # corners so near may come to touch within a step without an impact
TOUCH_M = 1e-7
IMPACT_PARTS = 8  # of an impact: friction acts against the slip of its own part


def roll_out(
    solid: Solid, start: Pose, steps_s: Float[jax.Array, " frame"], substeps: int = 4
) -> Pose:
    """The poses of one toss at all frames, `[frame + 1, ...]`; `substeps` from each to the next."""

    def advance(pose: Pose, _: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_impact(pose, left_s, is_last, solid)

    def frame(pose: Pose, dt_s: jax.Array):
        def substep(_: jax.Array, at: Pose) -> Pose:
            return step_by_events(advance, at, 0.0, dt_s / substeps, MAX_EVENTS)

        after = jax.lax.fori_loop(0, substeps, substep, pose)
        return after, after

    _, rest = jax.lax.scan(frame, start, steps_s)
    return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), start, rest)


def _to_impact(
    pose: Pose, left_s: jax.Array, is_last: jax.Array, solid: Solid
) -> tuple[Pose, jax.Array]:
    """Moves on to the next impact, or by `left_s`; returns the pose and the time it took.

    When `is_last`, by `left_s` in any case: what still comes then touches without an impact.
    """
    gaps, climbs = gaps_m(solid, pose), climbs_m_s(solid, pose)
    lowest = jax.lax.top_k(-gaps, MOST_CONTACTS)[1]
    lasts = ((gaps < NEAR_M) & (climbs > -PLASTIC_M_S)) | is_last

    def level(at: Pose, _: jax.Array) -> tuple[jax.Array, jax.Array]:
        return gaps_m(solid, at), climbs_m_s(solid, at)

    def after(spent_s: jax.Array) -> Pose:
        def at_middle(middle: Pose) -> tuple[jax.Array, Contacts]:
            levers = levers_m(solid, middle.quaternion[0])[lowest]
            least = least_rises_m_s(gaps[lowest], spent_s)
            falls = jnp.stack([jnp.zeros(()), jnp.zeros(()), -solid.gravity])
            return falls, _contacts(solid, levers, least, lasts[lowest] & (spent_s > 0))

        return _only(stepped(_alone(pose), _masses(solid), spent_s, at_middle)[0])

    def jump(at: Pose, hits: jax.Array) -> Pose:
        return _struck(at, solid, hits, lowest)

    return to_crossing(pose, after, level, jump, left_s, ~lasts)


def _struck(pose: Pose, solid: Solid, hits: jax.Array, lowest: jax.Array) -> Pose:
    """The pose after the impact of the corners that `hits` names, and of all that touch."""
    gaps, climbs = gaps_m(solid, pose)[lowest], climbs_m_s(solid, pose)[lowest]
    touches = hits[lowest] | (gaps < TOUCH_M)
    bounces = jnp.where(climbs < -PLASTIC_M_S, -solid.restitution * climbs, 0.0)
    levers = levers_m(solid, pose.quaternion)[lowest]

    def part(index: jax.Array, pose: Pose) -> Pose:
        share = (index + 1) / IMPACT_PARTS
        least = (1 - share) * jnp.minimum(climbs, 0.0) + share * bounces
        return struck(pose, _masses(solid), _contacts(solid, levers, least, touches))[0]

    # Where nothing touches, one part is as good as all.
    parts = jnp.where(jnp.any(touches), 0, IMPACT_PARTS - 1)
    return _only(jax.lax.fori_loop(parts, IMPACT_PARTS, part, _alone(pose)))


def _contacts(
    solid: Solid, levers: jax.Array, least_m_s: jax.Array, touches: jax.Array
) -> Contacts:
    """Of one body, at corners `[corner]`."""
    of_corners = levers, least_m_s, touches, solid.friction, jnp.zeros_like(levers)
    return Contacts(Corners(*(values[None] for values in of_corners)))


def _masses(solid: Solid) -> Masses:
    return Masses(solid.inertia_m2[None], jnp.ones(1))


def _alone(pose: Pose) -> Pose:
    """One of one body; `_only` is the way back."""
    return jax.tree.map(lambda values: values[None], pose)


def _only(pose: Pose) -> Pose:
    return jax.tree.map(lambda values: values[0], pose)

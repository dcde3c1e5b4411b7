"""The body engine: a convex body that is thrown onto a plane, from impact to impact, in JAX.

Impacts at corners are met at their time, whatever the steps. Between them one step is Moreau's
midpoint rule: half of the way as before, impulses at the corners that last on the plane, half of
the way as after. In flight that is exact up to the turning's Runge-Kutta step; in lasting contact
(sliding, rolling over an edge, rest) of second order. The motion is a continuous function of start
and parameters, with JAX's derivatives, as long as the order of the impacts stays the same.
MuJoCo is the check: tests/rollout/test_engine_body.py.

Source: Moreau (1988), see `body_contact`; Moreau (1999), Numerical aspects of the sweeping
process, Comput. Methods Appl. Mech. Eng. 177, 329.
"""

import functools

import jax
import jax.numpy as jnp
from jaxtyping import Float

from galileo_jax.rollout.body import (
    Pose,
    Solid,
    climbs_m_s,
    gaps_m,
    levers_m,
    mobility,
    rotation,
    turned_on,
)
from galileo_jax.rollout.body_contact import after_impulses
from galileo_jax.rollout.event_loop import step_by_events

MOST_CONTACTS = 4  # the lowest corners: of a box no more can touch
MAX_EVENTS = 8  # within one step
STEP_S = 1 / 592  # four to a frame at 148 Hz
SLOW_M_S = 0.02  # slower impacts are plastic: nothing rattles for ever
NEAR_M = 1e-3  # corners so near may come to touch within a step without an impact
TOUCH_M = 1e-7
IMPACT_PARTS = 8  # of an impact: friction acts against the slip of its own part
PUSH_OUT = 0.2  # share of a step's rounding that is taken back in the next
NEWTON_STEPS = 8


def roll_out(
    solid: Solid, start: Pose, steps_s: Float[jax.Array, " frame"], substeps: int = 4
) -> Pose:
    """One toss.

    Args:
      solid: the body and the plane.
      start: at the first frame.
      steps_s: from each frame to the next.
      substeps: so many steps from frame to frame; `substeps_for` of regular ones.

    Returns:
      the poses at all frames, `[frame + 1, ...]`.
    """

    def frame(pose: Pose, dt_s: jax.Array):
        def substep(_: int, at: Pose) -> Pose:
            return _step(at, dt_s / substeps, solid)

        after = jax.lax.fori_loop(0, substeps, substep, pose)
        return after, after

    _, rest = jax.lax.scan(frame, start, steps_s)
    return jax.tree.map(lambda one, more: jnp.concatenate([one[None], more]), start, rest)


@functools.partial(jax.jit, static_argnames=("substeps",))
def roll_out_batch(
    solid: Solid, start: Pose, steps_s: Float[jax.Array, "batch frame"], substeps: int = 4
) -> Pose:
    """Tosses side by side: all arguments with a leading batch axis."""
    return jax.vmap(functools.partial(roll_out, substeps=substeps))(solid, start, steps_s)


def substeps_for(frame_s: float) -> int:
    """So many steps from frame to frame that none is longer than `STEP_S`."""
    return max(1, round(frame_s / STEP_S + 0.499))


def _step(pose: Pose, dt_s: jax.Array, solid: Solid) -> Pose:
    def advance(pose: Pose, _: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_impact(pose, left_s, is_last, solid)

    # `step_by_events` counts down from a number.
    return step_by_events(advance, pose, jnp.zeros(()), dt_s, MAX_EVENTS)  # pyright: ignore


def _to_impact(
    pose: Pose, left_s: jax.Array, is_last: jax.Array, solid: Solid
) -> tuple[Pose, jax.Array]:
    """Moves on to the next impact, or by `left_s`; returns the pose and the time it took.

    When `is_last`, by `left_s` in any case: what still comes then touches without an impact.
    """
    gaps, climbs = gaps_m(solid, pose), climbs_m_s(solid, pose)
    lowest = jax.lax.top_k(-gaps, MOST_CONTACTS)[1]
    lasts = ((gaps < NEAR_M) & (climbs > -SLOW_M_S)) | is_last
    after = functools.partial(_moved, pose, solid, gaps[lowest], lasts[lowest], lowest)
    whole = after(left_s)
    ends = gaps_m(solid, whole)
    hits = ~lasts & (ends < 0)
    at = _crossing_s(gaps, climbs, ends, climbs_m_s(solid, whole), hits, left_s)
    soonest = jnp.min(at)
    struck = _struck(after(soonest), solid, at <= soonest, lowest)
    found = jax.tree.map(lambda one, other: jnp.where(jnp.any(hits), one, other), struck, whole)
    return found, jnp.where(jnp.any(hits), soonest, left_s)


def _moved(
    pose: Pose,
    solid: Solid,
    gaps: jax.Array,
    lasts: jax.Array,
    lowest: jax.Array,
    spent_s: jax.Array,
) -> Pose:
    """One step of Moreau's midpoint rule, with contacts that last at the `lowest` corners."""
    half = 0.5 * spent_s
    middle = turned_on(solid.inertia_m2, pose.quaternion, pose.momentum_m2_s, half)
    levers, turns = levers_m(solid, middle)[lowest], mobility(solid, rotation(middle))
    falls = jnp.stack([jnp.zeros(()), jnp.zeros(()), -solid.gravity])
    velocity = pose.velocity_m_s + spent_s * falls
    over = jnp.where(spent_s > 0, spent_s, 1.0)
    least = jnp.where(gaps > 0, -gaps, -PUSH_OUT * gaps) / over
    push, twist = after_impulses(
        velocity,
        turns @ pose.momentum_m2_s,
        levers,
        turns,
        least,
        lasts & (spent_s > 0),
        solid.friction,
    )
    momentum = pose.momentum_m2_s + twist
    return Pose(
        pose.position_m + half * (pose.velocity_m_s + velocity + push),
        turned_on(solid.inertia_m2, middle, momentum, half),
        velocity + push,
        momentum,
    )


def _crossing_s(
    gaps: jax.Array,
    climbs: jax.Array,
    ends: jax.Array,
    climbs_at_end: jax.Array,
    hits: jax.Array,
    left_s: jax.Array,
) -> Float[jax.Array, " corner"]:
    """When the corners meet the plane, inf for those that do not.

    On the cubic through height and speed at both ends of the step: in flight it is off by the
    fourth power of the step, 1e-11 m.
    """
    over = jnp.where(left_s > 0, left_s, 1.0)
    v0, v1 = climbs * over, climbs_at_end * over
    a, b = 2 * (gaps - ends) + v0 + v1, 3 * (ends - gaps) - 2 * v0 - v1
    low, high = jnp.zeros_like(gaps), jnp.ones_like(gaps)
    share = jax.lax.stop_gradient(gaps / jnp.where(hits, gaps - ends, 1.0))
    share = jnp.clip(share, 0.0, 1.0)
    for _ in range(NEWTON_STEPS):
        # The last of the steps carries the derivative of the instant.
        share = jax.lax.stop_gradient(share)
        height = ((a * share + b) * share + v0) * share + gaps
        slope = jax.lax.stop_gradient((3 * a * share + 2 * b) * share + v0)
        low = jnp.where(height > 0, jax.lax.stop_gradient(share), low)
        high = jnp.where(height > 0, high, jax.lax.stop_gradient(share))
        new = share - height / jnp.where(slope < 0, slope, -1.0)
        inside = (slope < 0) & (new >= low) & (new <= high)
        share = jnp.where(inside, new, 0.5 * (low + high))
    already = gaps <= 0
    return jnp.where(hits, jnp.where(already, 0.0, share * left_s), jnp.inf)


def _struck(pose: Pose, solid: Solid, hits: jax.Array, lowest: jax.Array) -> Pose:
    """The pose after the impact of the corners that `hits` names, and of all that touch."""
    gaps, climbs = gaps_m(solid, pose)[lowest], climbs_m_s(solid, pose)[lowest]
    touches = hits[lowest] | (gaps < TOUCH_M)
    bounces = jnp.where(climbs < -SLOW_M_S, -solid.restitution * climbs, 0.0)
    turns = mobility(solid, rotation(pose.quaternion))
    levers = levers_m(solid, pose.quaternion)[lowest]

    def part(index: jax.Array, carry: tuple[jax.Array, jax.Array]):
        velocity, momentum = carry
        share = (index + 1) / IMPACT_PARTS
        push, twist = after_impulses(
            velocity,
            turns @ momentum,
            levers,
            turns,
            (1 - share) * jnp.minimum(climbs, 0.0) + share * bounces,
            touches,
            solid.friction,
        )
        return velocity + push, momentum + twist

    # Where nothing touches, one part is as good as all.
    parts = jnp.where(jnp.any(touches), 0, IMPACT_PARTS - 1)
    carry = pose.velocity_m_s, pose.momentum_m2_s
    velocity, momentum = jax.lax.fori_loop(parts, IMPACT_PARTS, part, carry)
    return pose._replace(velocity_m_s=velocity, momentum_m2_s=momentum)

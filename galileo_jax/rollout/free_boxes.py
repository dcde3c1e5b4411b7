"""How boxes with six coordinates each move on a table: stand, slide, turn, tip and hit one another.

A box stands on four corners with Coulomb friction, and meets others with smooth faces. Hits are met
at their time (conservative advancement along the gap), so that the motion is a continuous function
of the parameters, with JAX's derivatives; between them boxes move by `moreau`'s step. Corners come
down onto the table without a rebound, within a step.

Source: Mirtich (1996), Impulse-based dynamic simulation of rigid body systems, thesis, Berkeley,
for the advancement.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import State, Surroundings
from galileo_jax.rollout.body import Pose, rotation
from galileo_jax.rollout.box_faces import Box, Touch, touch
from galileo_jax.rollout.box_impulses import Corners, Points
from galileo_jax.rollout.events import PLASTIC_M_S, reaches_s, step_by_events
from galileo_jax.rollout.moreau import (
    Contacts,
    Masses,
    least_rises_m_s,
    spins_rad_s,
    stepped,
    struck,
)
from galileo_jax.rollout.motion import Dynamics, state_at

MAX_EVENTS = 8  # within one step
SUBSTEPS = 3  # of a record: 1/720 s
MOST_CORNERS = 4  # the lowest: of a box no more can stand
NEAR_M = 1e-4  # faces so near may come to touch within a step without a hit
TOUCH_M = 1e-8
REACH_M = 0.01  # points farther apart are of no account in a step
STILL_M_S = 1e-6
TINY = 1e-30  # keeps the derivative of a length finite at 0
SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])


Pairs = Sequence[tuple[int, int]]


class Boxes(NamedTuple):
    """All boxes at one instant; x along the table, y across it, away from the camera, z up.

    Attributes:
      pose: `[box]`; each is turned from flat and level.
      stands_m_s2: `[box, corner, 3]`, what the table did over the last step, per mass and second.
      pushes_n: `[pair, point]`, and what the boxes did to each other.
    """

    pose: Pose
    stands_m_s2: Float[jax.Array, "box corner 3"]
    pushes_n: Float[jax.Array, "pair point"]


class Shapes(NamedTuple):
    """What the boxes are like, and the table.

    Attributes:
      half_m: `[box, 3]`, half the edges.
      inertia_m2: `[box, 3]`, moments of inertia over the mass.
      corner_m: `[box]`, where each centre is at the foot.
      law: of the motion.
      scene: the surroundings.
    """

    half_m: Float[jax.Array, "box 3"]
    inertia_m2: Float[jax.Array, "box 3"]
    corner_m: Float[jax.Array, " box"]
    law: Dynamics
    scene: Surroundings

    @property
    def masses(self) -> Masses:
        """Of all boxes."""
        return Masses(self.inertia_m2, 1.0 / self.law.inertia)

    @property
    def pairs(self) -> Pairs:
        """Which boxes may meet."""
        return list(combinations(range(len(self.half_m)), 2))


def record_later(boxes: Boxes, time_s: jax.Array, dt_s: float, shapes: Shapes) -> Boxes:
    """One recorded step."""

    def advance(boxes: Boxes, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array):
        return _to_next_hit(boxes, time_s, left_s, is_last, shapes)

    step_s = dt_s / SUBSTEPS

    def step(part: jax.Array, boxes: Boxes) -> Boxes:
        return step_by_events(advance, boxes, time_s + part * step_s, step_s, MAX_EVENTS)

    return jax.lax.fori_loop(0, SUBSTEPS, step, boxes)


def _to_next_hit(
    boxes: Boxes, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array, shapes: Shapes
) -> tuple[Boxes, jax.Array]:
    """Moves on until a hit is due, or by `left_s`; returns the boxes and the time it took.

    When `is_last`, by `left_s` in any case: what still comes then touches without a hit.
    """
    boxes = after_hits(boxes, time_s, shapes)
    soonest, lasts = left_s, []
    for gap, rate, meets in approaches(boxes.pose, time_s, shapes):
        last = (gap < NEAR_M) & (rate > -PLASTIC_M_S)
        soonest = jnp.where(last, soonest, jnp.minimum(soonest, meets))
        lasts.append(last | is_last)
    spent_s = jnp.where(is_last, left_s, soonest)
    return moved(boxes, lasts, time_s, spent_s, shapes), spent_s


def approaches(
    pose: Pose, time_s: jax.Array, shapes: Shapes
) -> list[tuple[jax.Array, jax.Array, jax.Array]]:
    """Of each pair how far its nearest points are apart, how fast they part, and when they meet.

    m, m/s and s: at accelerations that last; inf if never.
    """
    spin, a = spins_rad_s(pose, shapes.inertia_m2), _acceleration(pose, time_s, shapes)
    found = []
    for one, other in shapes.pairs:
        near = _touch(pose, (one, other), shapes)
        nearest = jnp.argmin(near.gaps_m)
        gap, rate = near.gaps_m[nearest], _opening_rate(pose, spin, near, (one, other))[nearest]
        faster = (a[other] - a[one]) @ near.normal
        comes = (rate < 0) & (gap > TOUCH_M)
        found.append((gap, rate, jnp.where(comes, reaches_s(gap, -rate, -faster), jnp.inf)))
    return found


def moved(
    boxes: Boxes, lasts: Sequence[jax.Array], time_s: jax.Array, spent_s: jax.Array, shapes: Shapes
) -> Boxes:
    """The boxes after a time, with the contacts that last: of each pair, whether it does."""
    law, pairs = shapes.law, shapes.pairs
    _, gaps = _corners(boxes.pose, shapes)
    lowest = _lowest(gaps)
    gaps = jnp.take_along_axis(gaps, lowest, axis=1)
    ahead = boxes.pose.velocity_m_s + 0.5 * spent_s * _acceleration(boxes.pose, time_s, shapes)

    def at_middle(middle: Pose) -> tuple[jax.Array, Contacts]:
        state = _state(middle._replace(velocity_m_s=ahead), time_s + 0.5 * spent_s, shapes)
        # Weight and drive move the inertia; MuJoCo's engines take it so, too.
        down = law.mass / law.inertia * law.gravity * jnp.cos(law.table_rad)
        pull = law.drive(state) / law.inertia
        levers, _ = _corners(middle, shapes)
        corners = Corners(
            jnp.take_along_axis(levers, lowest[..., None], axis=1),
            least_rises_m_s(gaps, spent_s),
            jnp.broadcast_to(spent_s > 0, gaps.shape),
            law.coefficient(state),
            spent_s * boxes.stands_m_s2,
        )
        points = []
        for last, pair, push in zip(lasts, pairs, boxes.pushes_n, strict=True):
            near = _touch(middle, pair, shapes)
            touches = (near.gaps_m < REACH_M) & last & (spent_s > 0)
            least = least_rises_m_s(near.gaps_m, spent_s)
            points.append(_points(middle, near, pair, least, touches, spent_s * push))
        fall = jnp.stack([pull, jnp.zeros_like(pull), -down], axis=1)
        return fall, Contacts(corners, points, pairs)

    pose, (stands, pushes) = stepped(boxes.pose, shapes.masses, spent_s, at_middle)
    over = jnp.where(spent_s > 0, spent_s, 1.0)
    return Boxes(pose, stands / over, jnp.stack(pushes) / over)


def after_hits(boxes: Boxes, time_s: jax.Array, shapes: Shapes) -> Boxes:
    """The boxes after the hits that are due; friction at the table takes part in them."""
    law, pose = shapes.law, boxes.pose
    spin = spins_rad_s(pose, shapes.inertia_m2)
    points, any_hit = [], jnp.zeros((), bool)
    for pair in shapes.pairs:
        near = _touch(pose, pair, shapes)
        opens, is_near = _opening_rate(pose, spin, near, pair), near.gaps_m < TOUCH_M
        is_hit = jnp.any(is_near & (opens < -PLASTIC_M_S))
        least = jnp.where(opens < -PLASTIC_M_S, -law.restitution * opens, 0.0)
        points.append(_points(pose, near, pair, least, is_near & is_hit, jnp.zeros_like(least)))
        any_hit = any_hit | is_hit
    levers, gaps = _corners(pose, shapes)
    lowest = _lowest(gaps)
    stands = (jnp.take_along_axis(gaps, lowest, axis=1) < NEAR_M) & any_hit
    corners = Corners(
        jnp.take_along_axis(levers, lowest[..., None], axis=1),
        jnp.zeros(stands.shape),
        stands,
        law.coefficient(_state(pose, time_s, shapes)),
        jnp.zeros((*stands.shape, 3)),
    )
    pose, _ = struck(pose, shapes.masses, Contacts(corners, points, shapes.pairs))
    return boxes._replace(pose=pose)


def _acceleration(pose: Pose, time_s: jax.Array, shapes: Shapes) -> jax.Array:
    """Of boxes that touch no other, `[box, 3]`, to look ahead with."""
    law, velocity = shapes.law, pose.velocity_m_s[:, :2]
    speed = jnp.sqrt(jnp.sum(velocity**2, axis=1) + TINY)
    state = _state(pose, time_s, shapes)
    drive, brake = law.drive(state) / law.inertia, law.brake(state) / law.inertia
    level = -(brake / speed)[:, None] * velocity
    level = jnp.where((speed > STILL_M_S)[:, None], level.at[:, 0].add(drive), 0.0)
    return jnp.concatenate([level, jnp.zeros_like(drive)[:, None]], axis=1)


def _state(pose: Pose, time_s: jax.Array, shapes: Shapes) -> State:
    """What a law sees: effects act along the travel."""
    path = pose.position_m[:, 0] - shapes.corner_m
    return state_at(path, pose.velocity_m_s[:, 0], time_s, shapes.scene)


def _touch(pose: Pose, pair: tuple[int, int], shapes: Shapes) -> Touch:
    """Where the faces of two boxes are nearest."""
    one, other = (
        Box(pose.position_m[i], rotation(pose.quaternion[i]), shapes.half_m[i]) for i in pair
    )
    return touch(one, other)


def _points(
    pose: Pose,
    near: Touch,
    pair: tuple[int, int],
    least_m_s: jax.Array,
    touches: jax.Array,
    guess_ns: jax.Array,
) -> Points:
    """The points at which two boxes touch, as `Points` has them."""
    levers = jnp.stack([near.points_m - pose.position_m[i] for i in pair])
    return Points(levers, near.normal, least_m_s, touches, guess_ns)


def _opening_rate(pose: Pose, spin: jax.Array, near: Touch, pair: tuple[int, int]) -> jax.Array:
    """How fast the points part, `[point]`, m/s."""
    one, other = (
        pose.velocity_m_s[i] + jnp.cross(spin[i], near.points_m - pose.position_m[i]) for i in pair
    )
    return (other - one) @ near.normal


def _corners(pose: Pose, shapes: Shapes) -> tuple[jax.Array, jax.Array]:
    """Of all corners the levers `[box, corner, 3]` and how high they are `[box, corner]`."""
    turned = jax.vmap(rotation)(pose.quaternion)
    levers = jnp.einsum("bij,bkj->bki", turned, SIGNS * shapes.half_m[:, None])
    return levers, pose.position_m[:, None, 2] + levers[..., 2]


def _lowest(gaps: jax.Array) -> jax.Array:
    """Which corners stand, `[box, corner]`: in an order that rounding does not change."""
    return jnp.sort(jax.lax.top_k(-gaps, MOST_CORNERS)[1], axis=1)

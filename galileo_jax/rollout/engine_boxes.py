"""Boxes that move freely, in JAX: from the first hit on they turn, tip and leave the plane.

Until two objects meet nothing makes them leave the plane: so far the rigid engine moves them, with
all its effects. From the last record before the first hit on each box has six coordinates. Records
begin anew with the hit, whose time Newton's method finds.

A box stands on four corners with Coulomb friction, and meets others with smooth faces. Hits are met
at their time (conservative advancement along the gap), so that the motion is a continuous function
of the parameters, with JAX's derivatives; between them boxes move by Moreau's step. Corners come
down onto the table without a rebound, within a step. MuJoCo's C engine is the check:
tests/rollout/test_engine_boxes.py.

Source: Mirtich (1996), Impulse-based dynamic simulation of rigid body systems, thesis, Berkeley,
for the advancement.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from galileo_jax.model.effects.effect import State, Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws
from galileo_jax.rollout.body import (
    Contacts,
    Masses,
    Pose,
    least_rises_m_s,
    rotation,
    spins_rad_s,
    stepped,
    struck,
)
from galileo_jax.rollout.box_faces import NUM_POINTS, Box, Touch, touch
from galileo_jax.rollout.box_impulses import TINY, Corners, Points
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.engine_path import PathSystem
from galileo_jax.rollout.events import (
    PLASTIC_M_S,
    Motion,
    Task,
    of_task,
    reaches_s,
)
from galileo_jax.rollout.free_start import (
    Poses,
    as_seen,
    between_records,
    check_free,
    in_space,
    past_the_foot_m,
    record_before_hit,
    with_depths,
)
from galileo_jax.rollout.motion import Dynamics, state_at
from galileo_jax.runtime.errors import InputError

MEETING_STEPS = 3  # of Newton's method
MAX_EVENTS = 8  # within one step
SUBSTEPS = 3  # of a record: 1/720 s
MOST_CORNERS = 4  # the lowest: of a box no more can stand
NEAR_M = 1e-4  # faces so near may come to touch within a step without a hit
TOUCH_M = 1e-8
REACH_M = 0.01  # points farther apart are of no account in a step
STILL_M_S = 1e-6
SIGNS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

Pair = tuple[int, int]


class Boxes(NamedTuple):
    """All boxes at one instant; x along the table, y across it, away from the camera, z up."""

    pose: Pose  # `[box]`; each is turned from flat and level
    # What the table did over the last step, per mass and second
    stands_m_s2: Float[jax.Array, "box corner 3"]
    pushes_n: Float[jax.Array, "pair point"]  # and what the boxes did to each other


class BoxTable:
    """What the boxes are like and the table, and how they move on it."""

    def __init__(self, law: Dynamics, scene: Surroundings):
        extents = scene.half_length_m, scene.half_depth_m, scene.half_height_m
        self.law, self.scene = law, scene
        self.half_m = jnp.stack([jnp.asarray(own) for own in extents], axis=1)
        square = self.half_m**2
        inertia_m2 = (jnp.sum(square, axis=1, keepdims=True) - square) / 3
        self.masses = Masses(inertia_m2, 1.0 / law.inertia)
        self.corner_m = jnp.asarray(scene.corner_m)
        self.pairs = list(combinations(range(len(scene.names)), 2))

    def flat(self, position: jax.Array, velocity: jax.Array) -> Boxes:
        """The boxes as they come over the table in the plane, from `[object, 2]`."""
        cos = jnp.cos(self.law.table_rad)
        path, speed = (position[:, 0] - self.corner_m) / cos, velocity[:, 0] / cos
        none, count = jnp.zeros_like(path), len(path)
        pose = Pose(
            jnp.stack(
                [self.corner_m + path, -jnp.asarray(self.scene.beside_m), self.half_m[:, 2]], axis=1
            ),
            jnp.zeros((count, 4)).at[:, 0].set(1.0),
            jnp.stack([speed, none, none], axis=1),
            jnp.zeros((count, 3)),
        )
        stands = jnp.zeros((count, MOST_CORNERS, 3))
        stands = stands.at[..., 2].set(self.law.gravity / MOST_CORNERS)
        return Boxes(pose, stands, jnp.zeros((len(self.pairs), NUM_POINTS)))

    def seen(self, boxes: Boxes) -> Poses:
        """Of one record, `[object, axis]`."""
        place, turned, speed, _ = boxes.pose
        return Poses(*as_seen(place, speed, self.law.table_rad, self.scene), turned)

    def record_later(
        self, boxes: Boxes, time_s: jax.Array, dt_s: float, is_meeting: jax.Array
    ) -> tuple[Boxes, jax.Array]:
        """The boxes one recorded step later, and how long that is.

        When `is_meeting`, as the first hit leaves them, however long it takes: records begin anew
        with the hit, so that it always is at the same place in a step. The motion is as smooth in
        the parameters as bodies are, not as steps are.
        """
        step_s = jnp.where(is_meeting, jnp.inf, dt_s / SUBSTEPS)
        most = jnp.where(is_meeting, MEETING_STEPS, MAX_EVENTS)

        def is_left(carry: tuple[Boxes, jax.Array, jax.Array, Any]) -> jax.Array:
            _, left_s, _, count = carry
            return ((left_s > 0) | is_meeting) & (count < most)

        def to_next(carry: tuple[Boxes, jax.Array, jax.Array, Any]):
            boxes, left_s, passed_s, count = carry
            is_last = (count == most - 1) & ~is_meeting
            boxes, spent_s, is_hit = self._to_next_hit(boxes, time_s + passed_s, left_s, is_last)
            # What meets the hit's other bodies later is for later records.
            left_s = jnp.where(is_meeting & is_hit, 0.0, left_s - spent_s)
            return boxes, left_s, passed_s + spent_s, count + 1

        def step(_: jax.Array, carry: tuple[Boxes, jax.Array]) -> tuple[Boxes, jax.Array]:
            boxes, passed_s = carry
            found = jax.lax.while_loop(is_left, to_next, (boxes, step_s, passed_s, 0))
            return found[0], found[2]

        parts = jnp.where(is_meeting, 1, SUBSTEPS)
        return jax.lax.fori_loop(0, parts, step, (boxes, jnp.zeros_like(time_s)))

    def _to_next_hit(
        self, boxes: Boxes, time_s: jax.Array, left_s: jax.Array, is_last: jax.Array
    ) -> tuple[Boxes, jax.Array, jax.Array]:
        """Behind the next hit, or by `left_s`: boxes, the time it took, and whether any was due.

        When `is_last`, by `left_s` in any case: what still comes then touches without a hit. Where
        nothing ends the time nothing moves.
        """
        soonest, lasts = left_s, []
        for gap, rate, meets in self._approaches(boxes.pose, time_s):
            last = (gap < NEAR_M) & (rate > -PLASTIC_M_S)
            soonest = jnp.where(last, soonest, jnp.minimum(soonest, meets))
            lasts.append(last | is_last)
        spent_s = jnp.where(is_last, left_s, soonest)
        spent_s = jnp.where(jnp.isfinite(spent_s), spent_s, 0.0)
        boxes = self._moved(boxes, lasts, time_s, spent_s)
        boxes, is_hit = self._after_hits(boxes, time_s + spent_s)
        return boxes, spent_s, is_hit

    def _approaches(
        self, pose: Pose, time_s: jax.Array
    ) -> list[tuple[jax.Array, jax.Array, jax.Array]]:
        """Of each pair how far its nearest points are apart, how fast they part, when they meet.

        m, m/s and s: at accelerations that last; inf if never.
        """
        spin, a = spins_rad_s(pose, self.masses.inertia_m2), self._acceleration(pose, time_s)
        found = []
        for one, other in self.pairs:
            near = self._touch(pose, (one, other))
            nearest = jnp.argmin(near.gaps_m)
            gap, rate = near.gaps_m[nearest], _opens_m_s(pose, spin, near, (one, other))[nearest]
            faster = (a[other] - a[one]) @ near.normal
            comes = (rate < 0) & (gap > TOUCH_M)
            found.append((gap, rate, jnp.where(comes, reaches_s(gap, -rate, -faster), jnp.inf)))
        return found

    def _moved(
        self, boxes: Boxes, lasts: Sequence[jax.Array], time_s: jax.Array, spent_s: jax.Array
    ) -> Boxes:
        """The boxes after a time, with the contacts that last: of each pair, whether it does."""
        law = self.law
        _, gaps = self._corners(boxes.pose)
        lowest = _lowest(gaps)
        gaps = jnp.take_along_axis(gaps, lowest, axis=1)
        ahead = boxes.pose.velocity_m_s + 0.5 * spent_s * self._acceleration(boxes.pose, time_s)

        def at_middle(middle: Pose) -> tuple[jax.Array, Contacts]:
            state = self._state(middle._replace(velocity_m_s=ahead), time_s + 0.5 * spent_s)
            # Weight and drive move the inertia; MuJoCo's engines take it so, too.
            down = law.mass / law.inertia * law.gravity * jnp.cos(law.table_rad)
            pull = law.drive(state) / law.inertia
            levers, _ = self._corners(middle)
            corners = Corners(
                jnp.take_along_axis(levers, lowest[..., None], axis=1),
                least_rises_m_s(gaps, spent_s),
                jnp.broadcast_to(spent_s > 0, gaps.shape),
                law.coefficient(state),
                spent_s * boxes.stands_m_s2,
            )
            points = []
            for last, pair, push in zip(lasts, self.pairs, boxes.pushes_n, strict=True):
                near = self._touch(middle, pair)
                touches = (near.gaps_m < REACH_M) & last & (spent_s > 0)
                least = least_rises_m_s(near.gaps_m, spent_s)
                points.append(_points(middle, near, pair, least, touches, spent_s * push))
            fall = jnp.stack([pull, jnp.zeros_like(pull), -down], axis=1)
            return fall, Contacts(corners, points, self.pairs)

        pose, (stands, pushes) = stepped(boxes.pose, self.masses, spent_s, at_middle)
        over = jnp.where(spent_s > 0, spent_s, 1.0)
        return Boxes(pose, stands / over, jnp.stack(pushes) / over)

    def _after_hits(self, boxes: Boxes, time_s: jax.Array) -> tuple[Boxes, jax.Array]:
        """The boxes after the hits that are due, and whether any is; the table rubs in them."""
        pose = boxes.pose
        spin = spins_rad_s(pose, self.masses.inertia_m2)
        points, any_hit = [], jnp.zeros((), bool)
        for pair in self.pairs:
            near = self._touch(pose, pair)
            opens, is_near = _opens_m_s(pose, spin, near, pair), near.gaps_m < TOUCH_M
            is_hit = jnp.any(is_near & (opens < -PLASTIC_M_S))
            least = jnp.where(opens < -PLASTIC_M_S, -self.law.restitution * opens, 0.0)
            points.append(_points(pose, near, pair, least, is_near & is_hit, jnp.zeros_like(least)))
            any_hit = any_hit | is_hit
        levers, gaps = self._corners(pose)
        lowest = _lowest(gaps)
        stands = (jnp.take_along_axis(gaps, lowest, axis=1) < NEAR_M) & any_hit
        corners = Corners(
            jnp.take_along_axis(levers, lowest[..., None], axis=1),
            jnp.zeros(stands.shape),
            stands,
            self.law.coefficient(self._state(pose, time_s)),
            jnp.zeros((*stands.shape, 3)),
        )
        pose, _ = struck(pose, self.masses, Contacts(corners, points, self.pairs))
        return boxes._replace(pose=pose), any_hit

    def _acceleration(self, pose: Pose, time_s: jax.Array) -> Float[jax.Array, "box 3"]:
        """Of boxes that touch no other, to look ahead with."""
        law, velocity = self.law, pose.velocity_m_s[:, :2]
        speed = jnp.sqrt(jnp.sum(velocity**2, axis=1) + TINY)
        state = self._state(pose, time_s)
        drive, brake = law.drive(state) / law.inertia, law.brake(state) / law.inertia
        level = -(brake / speed)[:, None] * velocity
        level = jnp.where((speed > STILL_M_S)[:, None], level.at[:, 0].add(drive), 0.0)
        return jnp.concatenate([level, jnp.zeros_like(drive)[:, None]], axis=1)

    def _state(self, pose: Pose, time_s: jax.Array) -> State:
        """What a law sees: effects act along the travel."""
        path = pose.position_m[:, 0] - self.corner_m
        return state_at(path, pose.velocity_m_s[:, 0], time_s, self.scene)

    def _touch(self, pose: Pose, pair: Pair) -> Touch:
        """Where the faces of two boxes are nearest."""
        one, other = (
            Box(pose.position_m[i], rotation(pose.quaternion[i]), self.half_m[i]) for i in pair
        )
        return touch(one, other)

    def _corners(self, pose: Pose) -> tuple[jax.Array, jax.Array]:
        """Of all corners the levers `[box, corner, 3]` and how high they are `[box, corner]`."""
        turned = jax.vmap(rotation)(pose.quaternion)
        levers = jnp.einsum("bij,bkj->bki", turned, SIGNS * self.half_m[:, None])
        return levers, pose.position_m[:, None, 2] + levers[..., 2]


def _points(
    pose: Pose,
    near: Touch,
    pair: Pair,
    least_m_s: jax.Array,
    touches: jax.Array,
    guess_ns: jax.Array,
) -> Points:
    """The points at which two boxes touch, as `Points` has them."""
    levers = jnp.stack([near.points_m - pose.position_m[i] for i in pair])
    return Points(levers, near.normal, least_m_s, touches, guess_ns)


def _opens_m_s(pose: Pose, spin: jax.Array, near: Touch, pair: Pair) -> jax.Array:
    """How fast the points part, `[point]`, m/s."""
    one, other = (
        pose.velocity_m_s[i] + jnp.cross(spin[i], near.points_m - pose.position_m[i]) for i in pair
    )
    return (other - one) @ near.normal


def _lowest(gaps: jax.Array) -> jax.Array:
    """Which corners stand, `[box, corner]`: in an order that rounding does not change."""
    return jnp.sort(jax.lax.top_k(-gaps, MOST_CORNERS)[1], axis=1)


@of_task
def roll_out(task: Task) -> Motion:
    """Boxes in the plane; NaN where they meet while the first still crosses the foot."""
    poses = free_poses(task)
    return poses.position_m[:, :2], poses.velocity_m_s[:, :2]


def free_poses(task: Task) -> Poses:
    """As `roll_out`, in space."""
    scene, dt_s = task.scene, task.dt_s
    planar = task.motion(PathSystem(task))
    table = BoxTable(task.law(), scene)
    num = jnp.asarray(task.num_records) if task.count is None else task.count
    begin = jnp.minimum(record_before_hit(*planar, scene, dt_s), num - 1)
    before = table.flat(planar[0][..., begin], planar[1][..., begin])

    def record(i: jax.Array, carry: tuple[Boxes, jax.Array, Poses]):
        boxes, late_s, made = carry
        is_meeting = i == begin
        from_s = jnp.where(is_meeting, i * dt_s, (i - 1) * dt_s + late_s)
        boxes, passed_s = table.record_later(boxes, from_s, dt_s, is_meeting)
        kept = jax.tree.map(lambda all_, one: all_.at[..., i].set(one), made, table.seen(boxes))
        return boxes, jnp.where(is_meeting, passed_s, late_s), kept

    length = planar[0].shape[-1]
    made = jax.tree.map(
        lambda one: jnp.broadcast_to(one[..., None], (*one.shape, length)), table.seen(before)
    )
    none_s = jnp.zeros_like(planar[0], shape=())
    _, late_s, made = jax.lax.fori_loop(begin, num, record, (before, none_s, made))
    at = jnp.minimum(jnp.arange(length), num - 1) - late_s / dt_s
    is_flat = (begin >= num - 1) | (planar[0][0, 0, begin] >= past_the_foot_m(scene))

    def known(after: jax.Array, before: jax.Array) -> jax.Array:
        return jnp.where(is_flat, jnp.where(at >= begin, after, before), jnp.nan)

    beside = jnp.asarray(scene.beside_m)
    return jax.tree.map(known, between_records(made, at, dt_s), in_space(*planar, beside))


class EngineBoxes(EngineJax):
    """Boxes that move freely, see the module."""

    roll_out = staticmethod(roll_out)

    def __init__(self, model: Model, laws: ActingLaws | None = None):
        """Raises `InputError` where an object is no box, or as `check_free`."""
        check_free(model)
        for name, shape in zip(model.scene.names, model.scene.shapes, strict=True):
            if shape != "box":
                raise InputError(f"engine: rigid: {name} is a {shape}; boxes expected, or c")
        super().__init__(model, laws, with_depths(model.scene))

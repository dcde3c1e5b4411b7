"""Boxes that move freely, in JAX: from the first hit on they turn, tip and leave the plane.

Until two objects meet nothing makes them leave the plane: so far the rigid engine moves them, with
all its effects. From the last record before the first hit on each box has six coordinates
(`free_boxes.py`). Records begin anew with the hit, whose time Newton's method finds. MuJoCo's C
engine is the check: tests/rollout/test_engine_boxes.py.
"""

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws
from galileo_jax.rollout.body import Pose
from galileo_jax.rollout.box_faces import NUM_POINTS
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.engine_path import path_system
from galileo_jax.rollout.events import Motion, Task, of_task
from galileo_jax.rollout.free_boxes import (
    MOST_CORNERS,
    Boxes,
    Shapes,
    after_hits,
    approaches,
    moved,
    record_later,
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
from galileo_jax.rollout.motion import Dynamics
from galileo_jax.runtime.errors import InputError

MEETING_STEPS = 3  # of Newton's method


@of_task
def roll_out(task: Task) -> Motion:
    """Boxes in the plane; NaN where they meet while the first still crosses the foot."""
    poses = free_poses(task)
    return poses.position_m[:, :2], poses.velocity_m_s[:, :2]


def free_poses(task: Task) -> Poses:
    """As `roll_out`, in space."""
    scene, dt_s = task.scene, task.dt_s
    planar = task.motion(path_system(task))
    shapes = _shapes(task.law(), scene)
    num = jnp.asarray(task.num_records) if task.count is None else task.count
    begin = jnp.minimum(record_before_hit(*planar, scene, dt_s), num - 1)
    before = _flat(planar[0][..., begin], planar[1][..., begin], shapes)
    first, late_s = _to_first_hit(before, begin * dt_s, shapes)

    def record(i: jax.Array, carry: tuple[Boxes, Poses]) -> tuple[Boxes, Poses]:
        boxes, made = carry
        boxes = record_later(boxes, (i - 1) * dt_s + late_s, dt_s, shapes)
        kept = jax.tree.map(lambda all_, one: all_.at[..., i].set(one), made, _seen(boxes, shapes))
        return boxes, kept

    length = planar[0].shape[-1]
    made = jax.tree.map(
        lambda one: jnp.broadcast_to(one[..., None], (*one.shape, length)), _seen(first, shapes)
    )
    made = jax.lax.fori_loop(begin + 1, num, record, (first, made))[1]
    at = jnp.minimum(jnp.arange(length), num - 1) - late_s / dt_s
    is_flat = (begin >= num - 1) | (planar[0][0, 0, begin] >= past_the_foot_m(scene))

    def known(after: jax.Array, before: jax.Array) -> jax.Array:
        return jnp.where(is_flat, jnp.where(at >= begin, after, before), jnp.nan)

    beside = jnp.asarray(scene.beside_m)
    return jax.tree.map(known, between_records(made, at, dt_s), in_space(*planar, beside))


def _to_first_hit(boxes: Boxes, time_s: jax.Array, shapes: Shapes) -> tuple[Boxes, jax.Array]:
    """The boxes as the first hit leaves them, and how long after `time_s` that is.

    Records begin anew with the hit, so that it always is at the same place in a step: the motion
    is as smooth in the parameters as bodies are, not as steps are.
    """
    late_s, none_last = jnp.zeros(()), [jnp.zeros((), bool) for _ in shapes.pairs]
    for _ in range(MEETING_STEPS):
        times = [meets for _, _, meets in approaches(boxes.pose, time_s + late_s, shapes)]
        soonest = jnp.min(jnp.stack(times))
        spent_s = jnp.where(jnp.isfinite(soonest), soonest, 0.0)
        boxes = moved(boxes, none_last, time_s + late_s, spent_s, shapes)
        late_s = late_s + spent_s
    return after_hits(boxes, time_s + late_s, shapes), late_s


def _shapes(law: Dynamics, scene: Surroundings) -> Shapes:
    half = jnp.stack(
        [
            jnp.asarray(own)
            for own in (scene.half_length_m, scene.half_depth_m, scene.half_height_m)
        ],
        axis=1,
    )
    square = half**2
    inertia = (jnp.sum(square, axis=1, keepdims=True) - square) / 3
    return Shapes(half, inertia, jnp.asarray(scene.corner_m), law, scene)


def _flat(position: jax.Array, velocity: jax.Array, shapes: Shapes) -> Boxes:
    """The boxes as they come over the table in the plane, from `[object, 2]`."""
    scene, cos = shapes.scene, jnp.cos(shapes.law.table_rad)
    path, speed = (position[:, 0] - shapes.corner_m) / cos, velocity[:, 0] / cos
    none = jnp.zeros_like(path)
    beside = -jnp.asarray(scene.beside_m)
    pose = Pose(
        jnp.stack([shapes.corner_m + path, beside, shapes.half_m[:, 2]], axis=1),
        jnp.zeros((len(path), 4)).at[:, 0].set(1.0),
        jnp.stack([speed, none, none], axis=1),
        jnp.zeros((len(path), 3)),
    )
    stands = jnp.zeros((len(path), MOST_CORNERS, 3))
    stands = stands.at[..., 2].set(shapes.law.gravity / MOST_CORNERS)
    return Boxes(pose, stands, jnp.zeros((len(shapes.pairs), NUM_POINTS)))


def _seen(boxes: Boxes, shapes: Shapes) -> Poses:
    """Of one record, `[object, axis]`."""
    place, turned, speed, _ = boxes.pose
    return Poses(*as_seen(place, speed, shapes.law.table_rad, shapes.scene), turned)


class EngineBoxes(EngineJax):
    """Boxes that move freely, see the module."""

    roll_out = staticmethod(roll_out)

    def __init__(self, model: Model, laws: ActingLaws | None = None):
        """Checks the scene.

        Raises:
          InputError: an object is no box, or as of `check_free`.
        """
        check_free(model)
        for name, shape in zip(model.scene.names, model.scene.shapes, strict=True):
            if shape != "box":
                raise InputError(f"engine: rigid: {name} is a {shape}; boxes expected, or c")
        super().__init__(model, laws, with_depths(model.scene))

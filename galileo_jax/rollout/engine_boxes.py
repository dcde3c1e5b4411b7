"""Boxes that move freely, in JAX: from the first hit on they turn, tip and leave the plane.

Until two objects meet nothing makes them leave the plane: so far the rigid engine moves them, with
all its effects. From the last record before the first hit on each box has six coordinates
(`free_boxes.py`). Records begin anew with the hit, whose time Newton's method finds. MuJoCo's C
engine is the check: tests/rollout/test_engine_boxes.py.
"""

from itertools import combinations
from typing import Any

import jax
import jax.numpy as jnp

from galileo_jax.model.effects.effect import Effect, Surroundings
from galileo_jax.model.model import Model
from galileo_jax.rollout.acting_laws import ActingLaws
from galileo_jax.rollout.box_faces import NUM_POINTS
from galileo_jax.rollout.engine_jax import EngineJax
from galileo_jax.rollout.engine_rigid import roll_out as roll_out_in_plane
from galileo_jax.rollout.free_boxes import (
    MOST_CORNERS,
    Boxes,
    Shapes,
    acceleration,
    meets_s,
    moved,
    opening_rate,
    record_later,
    struck,
    touch_of,
)
from galileo_jax.rollout.free_start import check_free, past_the_foot_m, with_depths
from galileo_jax.rollout.motion import Dynamics, dynamics
from galileo_jax.runtime.errors import InputError

MEETING_STEPS = 3  # of Newton's method
HIT_AHEAD = 1.5  # records: so far ahead of a hit the boxes are free


def roll_out(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
    acts: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array]:
    """One rollout: `[parameter]` to centres and velocities, each `[object, 2, record]`.

    As of `engine_rigid`; NaN where the objects meet while the first still crosses the foot.
    """
    position, velocity, _ = roll_out_poses(
        effects, names, num_records, dt_s, theta, scene, count, acts
    )
    return position[:, :2], velocity[:, :2]


def roll_out_poses(
    effects: tuple[Effect, ...],
    names: tuple[str, ...],
    num_records: int,
    dt_s: float,
    theta: jax.Array,
    scene: Surroundings,
    count: jax.Array | None = None,
    acts: jax.Array | None = None,
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """As `roll_out`, in space: places, velocities `[object, 3, record]`, quaternions too.

    x along the travel, y up, z towards the camera; quaternions `[object, 4, record]` in the axes
    (x, -z, y), as `engine_c_free.Poses`.
    """
    planar = roll_out_in_plane(effects, names, num_records, dt_s, theta, scene, count, acts)
    named = {name: theta[i] for i, name in enumerate(names)}
    shapes = _shapes(dynamics(effects, scene, named, jnp, acts), scene)
    num = jnp.asarray(num_records) if count is None else count
    begin = jnp.minimum(_begin(*planar, scene, dt_s), num - 1)
    before = _flat(planar[0][..., begin], planar[1][..., begin], shapes)
    first, late_s = _to_first_hit(before, begin * dt_s, shapes)

    def record(i: jax.Array, carry: tuple[Boxes, Any]) -> tuple[Boxes, Any]:
        boxes, made = carry
        boxes = record_later(boxes, (i - 1) * dt_s + late_s, dt_s, shapes)
        kept = jax.tree.map(lambda all_, one: all_.at[i].set(one), made, _seen(boxes, shapes))
        return boxes, kept

    length = planar[0].shape[-1]
    made = jax.tree.map(
        lambda one: jnp.broadcast_to(one, (length, *one.shape)), _seen(first, shapes)
    )
    made = jax.lax.fori_loop(begin + 1, num, record, (first, made))[1]
    at = jnp.minimum(jnp.arange(length), num - 1) - late_s / dt_s
    is_flat = (begin >= num - 1) | (planar[0][0, 0, begin] >= past_the_foot_m(scene))
    place, speed, turned = (
        jnp.where(is_flat, jnp.where(at >= begin, after, own), jnp.nan)
        for after, own in zip(_between(made, at, dt_s), _level(*planar, scene), strict=True)
    )
    return place, speed, turned


def _to_first_hit(boxes: Boxes, time_s: jax.Array, shapes: Shapes) -> tuple[Boxes, jax.Array]:
    """The boxes as the first hit leaves them, and how long after `time_s` that is.

    Records begin anew with the hit, so that it always is at the same place in a step: the motion
    is as smooth in the parameters as bodies are, not as steps are.
    """
    pairs = list(combinations(range(len(shapes.half_m)), 2))
    late_s = jnp.zeros(())
    for _ in range(MEETING_STEPS):
        a, spin = acceleration(boxes, time_s + late_s, shapes), jnp.zeros_like(boxes.place_m)
        times = [jnp.asarray(jnp.inf)]
        for pair in pairs:
            found = touch_of(boxes, pair, shapes)
            rate = opening_rate(boxes, spin, found, pair)[0]
            faster = (a[pair[1]] - a[pair[0]]) @ found.normal
            times.append(meets_s(jnp.min(found.gaps_m), rate, faster))
        soonest = jnp.min(jnp.stack(times))
        spent_s = jnp.where(jnp.isfinite(soonest), soonest, 0.0)
        lasts = [jnp.zeros((), bool) for _ in pairs]
        boxes = moved(boxes, lasts, pairs, time_s + late_s, spent_s, shapes)
        late_s = late_s + spent_s
    touches = [touch_of(boxes, pair, shapes) for pair in pairs]
    return struck(boxes, touches, pairs, time_s + late_s, shapes), late_s


def _between(made: Any, at: jax.Array, dt_s: float) -> tuple[jax.Array, jax.Array, jax.Array]:
    """What was `made` `[record, ...]` at other times, by Hermite's cubics: `[..., record]`.

    Args:
      made: places, velocities and quaternions.
      at: `[record]`, when, in records.
      dt_s: from one to the next.
    """
    place, speed, turned = made
    last = place.shape[0] - 2
    i = jnp.clip(jnp.floor(at).astype(int), 0, last)
    s = (at - i)[:, None, None]
    x0, x1 = place[i], place[i + 1]
    v0, v1 = speed[i] * dt_s, speed[i + 1] * dt_s
    a, b = 2 * (x0 - x1) + v0 + v1, 3 * (x1 - x0) - 2 * v0 - v1
    mixed = turned[i] * (1 - s) + turned[i + 1] * s
    found = (
        ((a * s + b) * s + v0) * s + x0,
        (v0 + (v1 - v0) * s) / dt_s,
        mixed / jnp.linalg.norm(mixed, axis=-1, keepdims=True),
    )
    place, speed, turned = (jnp.moveaxis(own, 0, -1) for own in found)
    return place, speed, turned


def _level(
    position: jax.Array, velocity: jax.Array, scene: Surroundings
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Motion in the plane as motion in space."""
    beside = jnp.broadcast_to(jnp.asarray(scene.beside_m)[:, None, None], position[:, :1].shape)
    turned = jnp.array([1.0, 0.0, 0.0, 0.0])[:, None]
    return (
        jnp.concatenate([position, beside], axis=1),
        jnp.concatenate([velocity, jnp.zeros_like(beside)], axis=1),
        jnp.broadcast_to(turned, (len(position), 4, position.shape[-1])),
    )


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


def _begin(position: jax.Array, velocity: jax.Array, scene: Surroundings, dt_s: float) -> jax.Array:
    """The last record before any faces meet; the number of records if none do."""
    half = jnp.asarray(scene.half_length_m)[:, None]
    x, v = position[:, 0], velocity[:, 0]
    gap = x[1:] - x[:-1] - half[1:] - half[:-1]
    closing = v[:-1] - v[1:]
    near = jnp.any((closing > 0) & (gap < HIT_AHEAD * closing * dt_s), axis=0)
    return jnp.where(jnp.any(near), jnp.argmax(near), x.shape[-1])


def _flat(position: jax.Array, velocity: jax.Array, shapes: Shapes) -> Boxes:
    """The boxes as they come over the table in the plane, from `[object, 2]`."""
    scene, cos = shapes.scene, jnp.cos(shapes.law.table_rad)
    path, speed = (position[:, 0] - shapes.corner_m) / cos, velocity[:, 0] / cos
    none = jnp.zeros_like(path)
    quaternion = jnp.zeros((len(path), 4)).at[:, 0].set(1.0)
    place = jnp.stack(
        [shapes.corner_m + path, -jnp.asarray(scene.beside_m), shapes.half_m[:, 2]], axis=1
    )
    stands = jnp.zeros((len(path), MOST_CORNERS, 3))
    return Boxes(
        place,
        quaternion,
        jnp.stack([speed, none, none], axis=1),
        jnp.zeros((len(path), 3)),
        stands.at[..., 2].set(shapes.law.gravity / MOST_CORNERS),
        jnp.zeros((len(path) * (len(path) - 1) // 2, NUM_POINTS)),
    )


def _seen(boxes: Boxes, shapes: Shapes) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Places and velocities as the camera has its axes, on a table that may slope, and turnings."""
    cos, sin = jnp.cos(shapes.law.table_rad), jnp.sin(shapes.law.table_rad)
    x, across, up = boxes.place_m.T
    path = x - shapes.corner_m
    along, aside, rises = boxes.velocity_m_s.T
    place = jnp.stack([shapes.corner_m + path * cos, up - path * sin, -across], axis=1)
    speed = jnp.stack([along * cos, rises - along * sin, -aside], axis=1)
    return place, speed, boxes.quaternion


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

"""From motion in a plane to bodies that move freely: where, which scenes have a place, and back.

In the array standard, so that the same lines run in NumPy (C engine) and in JAX.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import jax
from jaxtyping import Int

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.scene.scene import Scene
from galileo_jax.rollout.events import cubic
from galileo_jax.rollout.motion import Array
from galileo_jax.rollout.mujoco_fields import FOOT_ZONE_M
from galileo_jax.runtime.errors import InputError

CLEAR_M = 0.01  # starts are known within a few mm
HIT_AHEAD = 1.5  # records: so far ahead of a hit bodies are free


class Poses(NamedTuple):
    """Where bodies are and how they are turned."""

    position_m: Array  # `[..., object, 3, record]`: x along the travel, y up, z towards the camera
    velocity_m_s: Array
    # `[..., object, 4, record]`, how each is turned from flat and level, in the axes (x, -z, y)
    quaternion: Array


def check_free(model: Model) -> None:
    """Checks that a model's bodies may move freely.

    Raises:
      InputError: no two objects can meet on the table, they meet at the foot, or one rolls.
    """
    scene = model.scene.surroundings
    if not scene.has_table or len(scene.names) < 2:
        raise InputError("motion: free: two objects that meet on a table expected, or planar")
    if any(scene.rolls):
        raise InputError("motion: free: nothing may roll; objects that slide expected, or planar")
    face = scene.start_m[1][0] - scene.half_length_m[1]
    needed = past_the_foot_m(scene) + scene.half_length_m[0] + CLEAR_M
    if face < needed:
        raise InputError(
            f"motion: free: {scene.names[1]}'s face is {face:.3f} m past the foot, where it is hit "
            f"by what still crosses the foot; {needed:.3f} m or more expected, or planar"
        )


def past_the_foot_m(scene: Surroundings) -> float | jax.Array:
    """Where object 1's centre (x) is when all of it is on the table, beyond the foot's zone."""
    # Inside a compiled program the numbers are JAX's.
    beyond = scene.corner_m[0] + FOOT_ZONE_M
    half = scene.half_length_m[0]
    return half + (beyond - half) * (beyond > half)


def with_depths(scene: Scene) -> Surroundings:
    """The surroundings with the boxes' extents and places across the travel."""
    each = zip(scene.objects, scene.surroundings.half_length_m, strict=True)
    # A box of unknown size is as deep as it is long.
    half = tuple(one.size_m[1] / 2 if one.size_m else length for one, length in each)
    return replace(scene.surroundings, half_depth_m=half, beside_m=scene.z_m)


def in_space(position_m: Array, velocity_m_s: Array, beside_m: Array) -> Poses:
    """Motion in the plane, `[..., object, 2, record]`, as motion in space: flat and level.

    `beside_m` `[object]`: how far each is from the plane.
    """
    xp = position_m.__array_namespace__()
    beside = xp.broadcast_to(xp.asarray(beside_m)[:, None, None], position_m[..., :1, :].shape)
    none = xp.zeros_like(beside)
    return Poses(
        xp.concat([position_m, beside], axis=-2),
        xp.concat([velocity_m_s, none], axis=-2),
        xp.concat([none + 1.0, none, none, none], axis=-2),
    )


def record_before_hit(
    position_m: Array, velocity_m_s: Array, scene: Surroundings, dt_s: float
) -> Int[Any, "..."]:
    """The last record before any faces meet, `[...]`; the number of records if none do."""
    xp = position_m.__array_namespace__()
    half = xp.asarray(scene.half_length_m)[:, None]
    x, v = position_m[..., 0, :], velocity_m_s[..., 0, :]
    gap = x[..., 1:, :] - x[..., :-1, :] - (half[1:] + half[:-1])
    closing = v[..., :-1, :] - v[..., 1:, :]
    near = xp.any((closing > 0) & (gap < HIT_AHEAD * closing * dt_s), axis=-2)
    return xp.where(xp.any(near, axis=-1), xp.argmax(near, axis=-1), x.shape[-1])


def as_seen(
    place_m: Array, speed_m_s: Array, table_rad: Array, scene: Surroundings
) -> tuple[Array, Array]:
    """Places and speeds `[..., object, 3]` in the camera's axes, of a table that may slope.

    Given as bodies have them: along the table, across it away from the camera, and up. The table
    is tilted about the foot by `table_rad` `[...]`.
    """
    xp = place_m.__array_namespace__()
    cos, sin = xp.cos(table_rad)[..., None], xp.sin(table_rad)[..., None]
    corner = xp.asarray(scene.corner_m)

    def tilted(values: Array, foot: Array | float) -> Array:
        along, across, up = (values[..., axis] for axis in range(3))
        path = along - foot
        return xp.stack([foot + path * cos, up - path * sin, -across], axis=-1)

    return tilted(place_m, corner), tilted(speed_m_s, 0.0)


def between_records(poses: Poses, at: Array, dt_s: float) -> Poses:
    """The poses at other times `at` `[time]`, in records of `dt_s`, by Hermite's cubics."""
    xp = at.__array_namespace__()
    last = poses.position_m.shape[-1] - 2
    i = xp.clip(xp.floor(at).astype(int), 0, last)
    s = at - i
    (x0, v0, q0), (x1, v1, q1) = ([values[..., k] for values in poses] for k in (i, i + 1))
    turned = q0 * (1 - s) + q1 * s
    return Poses(
        cubic(x0, x1, v0 * dt_s, v1 * dt_s, s)[0],
        v0 + (v1 - v0) * s,
        turned / xp.sqrt(xp.sum(turned**2, axis=-2, keepdims=True)),
    )

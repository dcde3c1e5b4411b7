"""Where bodies that move freely take over from motion in a plane, and which scenes have a place."""

from dataclasses import replace

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.scene.scene import UNKNOWN_BOX_M, Scene
from galileo_jax.rollout.mujoco_fields import FOOT_ZONE_M
from galileo_jax.runtime.errors import InputError

CLEAR_M = 0.01  # starts are known within a few mm


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


def past_the_foot_m(scene: Surroundings) -> float:
    """Where object 1's centre (x) is when all of it is on the table, beyond the foot's zone."""
    # Inside a compiled program the numbers are JAX's.
    beyond = scene.corner_m[0] + FOOT_ZONE_M
    half = scene.half_length_m[0]
    return half + (beyond - half) * (beyond > half)


def with_depths(scene: Scene) -> Surroundings:
    """The surroundings with the boxes' extents and places across the travel."""

    def depth(size_m: tuple[float, ...] | None) -> float:
        return (size_m or UNKNOWN_BOX_M)[1] / 2

    return replace(
        scene.surroundings,
        half_depth_m=tuple(depth(each.size_m) for each in scene.objects),
        beside_m=scene.z_m,
    )

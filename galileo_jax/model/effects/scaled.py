"""Lengths that are measured with a scale which is off by a share s.

    measured = true (1 + s)    about the foot (without a table: about object 1's start)

Source: Hartley and Zisserman, Multiple View Geometry (2004), chapter 6 (a camera square to
a plane scales it).
"""

from galileo_jax.model.effects.effect import Array, Surroundings


def unscaled(path_m: Array, error: Array) -> Array:
    """True starts `[..., object]` of those that were read from the measured track."""
    return path_m / (1.0 + error[..., None])


def scaled(position_m: Array, error: Array | float, scene: Surroundings) -> Array:
    """True centres `[object, 2, frame]` as they are measured."""
    if scene.has_table:
        return position_m + error * position_m
    origin = position_m.__array_namespace__().asarray(scene.start_m[0])[:, None]
    return position_m + error * (position_m - origin)

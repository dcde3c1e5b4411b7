"""Lengths that are measured with a scale which is off by a share s.

    measured = true (1 + s)    about the foot (without a table: about object 1's start)

Source: Hartley and Zisserman, Multiple View Geometry (2004), chapter 6 (a camera square to
a plane scales it).
"""

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta


class Scaled(Effect):
    """A scale that is off by a share s, the parameter of the effect's name."""

    def start(self, path_m: Array, theta: Theta, scene: Surroundings) -> Array:
        """The true starts, of those that were read from the measured track."""
        return path_m / (1.0 + theta[self.name][..., None])

    def measure(self, position_m: Array, theta: Theta, scene: Surroundings) -> Array:
        """The centres as the declared scale shows them."""
        error = theta[self.name]
        if scene.has_table:
            return position_m + error * position_m
        origin = position_m.__array_namespace__().asarray(scene.start_m[0])[:, None]
        return position_m + error * (position_m - origin)

"""Ramp angle: the ramp is steeper (or flatter) than declared.

    a = declared + ramp_angle

Motion down the ramp then has another acceleration and another direction in the picture.

Source: Galileo, Discorsi, third day (1638).
Confused with: k1 where only speeds on the ramp are seen: g (sin a - k cos a) changes alike.
The direction of travel in the picture and friction on the table tell them apart.
"""

import math

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, math.radians(2.0))


def _has_ramp(scene: Surroundings) -> bool:
    """Whether an object is on a ramp."""
    return scene.has_surface and (any(scene.comes_down) or not scene.has_table)


@register
class RampAngle(Effect, where=_has_ramp):
    """The declared angle of the ramp is wrong."""

    name = "ramp_angle"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """How much steeper the ramp is; none where nothing is on it, or in a fall."""
        return (Parameter("ramp_angle", "rad", PRIOR, 0.0, "effect", 0.05),)

    def tilt(self, theta: Theta, scene: Surroundings) -> tuple[Array, Array]:
        """Of the ramp alone."""
        steeper = theta["ramp_angle"]
        return steeper, 0.0 * steeper

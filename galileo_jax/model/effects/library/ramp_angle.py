"""Ramp angle: the ramp is steeper (or flatter) than declared.

    a = declared + ramp_angle

Motion down the ramp then has another acceleration and another direction in the picture.

Source: Galileo, Discorsi, third day (1638).
Confused with: k1 where only speeds on the ramp are seen: g (sin a - k cos a) changes alike.
The direction of travel in the picture and friction on the table tell them apart.
"""

import math

from galileo_jax.model.effects import Effect, Normal, Parameter, Surroundings, register

PRIOR = Normal(0.0, math.radians(2.0))


def _has_ramp(scene: Surroundings) -> bool:
    """Whether an object is on a ramp."""
    return scene.has_surface and (any(scene.comes_down) or not scene.has_table)


@register
class RampAngle(Effect, where=_has_ramp):
    name = "ramp_angle"
    unknowns = (Parameter("ramp_angle", "rad", PRIOR, 0.0, "effect", 0.05),)

    def tilt(self, theta, scene):
        steeper = theta["ramp_angle"]
        return steeper, 0.0 * steeper

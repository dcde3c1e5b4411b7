"""Camera roll: gravity does not point straight down in the picture.

    g = gravity (sin r, -cos r),    r = camera_roll, forward of the picture's vertical

Source: Hartley and Zisserman, Multiple View Geometry (2004), chapter 6 (a camera that is turned
about its line of sight turns the picture).
Confused with: magnus where the direction of flight hardly changes, and a level force. A plumb line
in the picture tells; `vertical_sd_deg` allows for it in every model.
"""

import math

from galileo_jax.model.effects import Effect, Normal, Parameter, Surroundings, register
from galileo_jax.model.effects.effect import ANGLE

PRIOR = Normal(0.0, math.radians(2.0))


def _shows_gravity(scene: Surroundings) -> bool:
    """Whether there is a picture's vertical, and it is taken at its word."""
    return scene.moves_in_plane and scene.num_axes == 2 and ANGLE not in scene.expected


@register
class CameraRoll(Effect, where=_shows_gravity):
    name = "camera_roll"
    unknowns = (Parameter("camera_roll", "rad", PRIOR, 0.0, "effect", 0.05),)

    def tilt(self, theta, scene):
        forward = theta["camera_roll"]
        return forward, 0.0 * forward

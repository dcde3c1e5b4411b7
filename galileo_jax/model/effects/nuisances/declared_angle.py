"""Declared angle: read off a picture or a protractor, it is known to so and so many tenths.

The ramp is steeper than declared by some `ramp_angle_sd_deg`, in each clip on its own.

Clips at several angles tell friction and scale by the differences of the angles, and no
better than these are known. In a flight it is gravity that points so far forward of the
picture's vertical (`vertical_sd_deg`).
"""

from galileo_jax.model.effects import Effect, Normal, Parameter
from galileo_jax.model.effects.effect import ANGLE


class DeclaredAngle(Effect, where=lambda scene: ANGLE in scene.expected):
    name = ANGLE

    def parameters(self, scene):
        prior = Normal(*scene.expected[self.name])
        return (Parameter(self.name, "rad", prior, 0.0, "nuisance", 0.1),)

    def tilt(self, theta, scene):
        steeper = theta[self.name]
        return steeper, 0.0 * steeper

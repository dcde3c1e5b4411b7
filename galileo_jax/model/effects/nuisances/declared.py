"""Declared numbers that were read off a picture: they are as good as the yaml says.

Angle: the ramp is steeper than declared by some `ramp_angle_sd_deg`, in each clip on its own. Clips
at several angles tell friction and scale by the differences of the angles, and no better than these
are known. In a flight it is gravity that points so far forward of the picture's vertical
(`vertical_sd_deg`).

Scale: measured lengths are true ones times 1 + s, with s of the size `pixels_per_metre_sd` tells.
As the effect `scale_error`, which is for scales that are wrong by more than anybody said.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter
from galileo_jax.model.effects.effect import ANGLE
from galileo_jax.model.effects.scaled import Scaled


class DeclaredAngle(Effect, where=lambda scene: ANGLE in scene.expected):
    name = ANGLE

    def parameters(self, scene):
        prior = Normal(*scene.expected[self.name])
        return (Parameter(self.name, "rad", prior, 0.0, "nuisance", 0.1),)

    def tilt(self, theta, scene):
        steeper = theta[self.name]
        return steeper, 0.0 * steeper


class DeclaredScale(Scaled, where=lambda scene: "declared_scale" in scene.expected):
    name = "declared_scale"

    def parameters(self, scene):
        prior = Normal(*scene.expected[self.name])
        return (Parameter(self.name, "1", prior, 0.0, "nuisance", 0.1),)

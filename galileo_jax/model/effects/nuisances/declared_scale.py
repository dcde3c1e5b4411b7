"""Declared scale: read off a picture, it is as good as the two pixels it was read from.

Measured lengths are true ones times 1 + s, with s of the size `pixels_per_metre_sd` tells.

As the effect `scale_error`, which is for scales that are wrong by more than anybody said.
"""

from galileo_jax.model.effects import Normal, Parameter
from galileo_jax.model.effects.scaled import Scaled


class DeclaredScale(Scaled, where=lambda scene: "declared_scale" in scene.expected):
    name = "declared_scale"

    def parameters(self, scene):
        prior = Normal(*scene.expected[self.name])
        return (Parameter(self.name, "1", prior, 0.0, "nuisance", 0.1),)

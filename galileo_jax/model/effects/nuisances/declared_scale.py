"""Declared scale: read off a picture, it is as good as the two pixels it was read from."""

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.scaled import Scaled
from galileo_jax.model.parameters import Normal, Parameter


class DeclaredScale(Scaled, where=lambda scene: "declared_scale" in scene.expected):
    """Measured lengths are true ones times 1 + s, with s of the size `pixels_per_metre_sd` tells.

    As the effect `scale_error`, which is for scales that are wrong by more than anybody said.
    """

    name = "declared_scale"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The relative error s; none where the scale is taken at its word, or unknown."""
        prior = Normal(*scene.expected[self.name])
        return (Parameter(self.name, "1", prior, 0.0, "nuisance", 0.1),)

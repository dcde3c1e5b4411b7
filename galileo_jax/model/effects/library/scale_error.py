"""Scale error: pixels_per_metre is not what was declared.

    measured = true (1 + s)    (`effects/scaled.py`)

Starts were read from the measured track, so that the true ones are start / (1 + s); sizes
were measured with a ruler and stay.

Source: Hartley and Zisserman, Multiple View Geometry (2004), chapter 6 (a camera square to
a plane scales it).
Confused with: frame_rate (both act like another gravity, g (1 + s) against g (1 + r)^2);
rolling; on one slope k1 and ramp_angle.
"""

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.effects.registry import register
from galileo_jax.model.effects.scaled import Scaled
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 0.07)


@register
class ScaleError(Scaled, where=lambda scene: scene.is_scale_known):
    """The declared scale is wrong."""

    name = "scale_error"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The relative error s; none where the scale is itself unknown (pixel_scale)."""
        return (Parameter("scale_error", "1", PRIOR, 0.0, "effect", 0.05),)

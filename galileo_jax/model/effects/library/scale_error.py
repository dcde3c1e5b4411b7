"""Scale error: pixels_per_metre is not what was declared.

    measured = true (1 + s)    (`effects/scaled.py`)

Starts were read from the measured track, so that the true ones are start / (1 + s); sizes
were measured with a ruler and stay.

Source: Hartley and Zisserman, Multiple View Geometry (2004), chapter 6 (a camera square to
a plane scales it).
Confused with: frame_rate (both act like another gravity, g (1 + s) against g (1 + r)^2);
rolling; on one slope k1 and ramp_angle.
"""

from galileo_jax.model.effects import Normal, Parameter, register
from galileo_jax.model.effects.scaled import Scaled


@register
class ScaleError(Scaled, where=lambda scene: scene.is_scale_known):
    name = "scale_error"
    unknowns = (Parameter("scale_error", "1", Normal(0.0, 0.07), 0.0, "effect", 0.05),)

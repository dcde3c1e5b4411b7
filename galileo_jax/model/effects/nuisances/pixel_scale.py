"""Pixel scale: how many pixels a metre is, where nobody declared it.

Measured lengths are true ones times pixels_per_metre / nominal scale.

A frictionless fall tells the scale from gravity; on one slope only
scale * (sin a - k cos a) shows, and neither it nor k can be determined.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M


class PixelScale(Effect, where=lambda scene: not (scene.is_scale_known or scene.is_level)):
    name = "pixel_scale"
    prior = LogNormal(NOMINAL_SCALE_PX_PER_M, 1.0)
    unknowns = (Parameter("pixels_per_metre", "px/m", prior, prior.median, "main", step=None),)

    def measure(self, position_m, theta, scene):
        xp = position_m.__array_namespace__()
        origin = xp.asarray(scene.start_m[0])[:, None]
        factor = theta["pixels_per_metre"] / NOMINAL_SCALE_PX_PER_M
        return origin + (position_m - origin) * factor

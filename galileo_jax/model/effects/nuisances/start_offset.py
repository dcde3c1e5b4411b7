"""Start offset: each object starts a few millimetres from where it was marked.

Moves each start along the object's path, downhill positive.

For object 1 it is the distance to the foot, for the others the gap before they are hit. A
foot that is known no better than `origin_sd_px` shifts all of them.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter
from galileo_jax.model.effects.effect import ORIGIN

SD_M = 0.003  # a point set by hand, sizes declared to a millimetre


class StartOffset(Effect, where=lambda scene: scene.has_table):
    name = "start_offset"

    def parameters(self, scene):
        _, origin_sd_m = scene.expected.get(ORIGIN, (0.0, 0.0))
        sd_m = (SD_M**2 + origin_sd_m**2) ** 0.5
        return tuple(
            Parameter(f"start_offset_{name}", "m", Normal(0.0, sd_m), 0.0, "nuisance", 0.15)
            for name in scene.names
        )

    def start(self, path_m, theta, scene):
        offsets = [theta[f"start_offset_{name}"] for name in scene.names]
        return path_m + offsets[0].__array_namespace__().stack(offsets, axis=-1)

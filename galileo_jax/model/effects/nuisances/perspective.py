"""Perspective: who films a high fall from the ground looks up, and the scale changes on the way.

The picture grows along a fall by `exp(-p)` at its top to `exp(p)` at its end.

    seen = h w / (w + (1 - w) exp(p)),    w = fallen / h

h: the length of the fall; right at both ends, where the scale was set. So a pinhole camera
sees a vertical line when it is pitched: p is about t h / (L (1 + t^2)) for a camera at a
distance L, pitched by atan t. Only in high falls (`assembly/expected.py`), whose middle is at
nobody's eye height. Past the end, where a wrong model may fall, the scale stays.

Source: Hartley and Zisserman, Multiple View Geometry (2004), section 8.6 (a vertical line
seen by a tilted camera).
"""

from galileo_jax.model.effects import Effect, Normal, Parameter
from galileo_jax.model.effects.effect import FALL_LENGTH


class Perspective(Effect, where=lambda scene: "perspective" in scene.expected):
    name = "perspective"

    def parameters(self, scene):
        prior = Normal(*scene.expected[self.name])
        return (Parameter(self.name, "1", prior, 0.0, "nuisance", step=None),)

    def measure(self, position_m, theta, scene):
        xp = position_m.__array_namespace__()
        length, _ = scene.expected[FALL_LENGTH]
        y = position_m[:, 1]
        fallen = (scene.start_m[0][1] - y) / length
        growth = xp.exp(theta[self.name])
        inside = xp.minimum(fallen, 1.0)
        past = growth * (fallen - inside)
        seen = inside / (inside + (1.0 - inside) * growth) + past
        # y itself where nothing grows, to the last bit.
        distorted = y - length * (seen - fallen)
        return xp.stack([position_m[:, 0], distorted], axis=1)

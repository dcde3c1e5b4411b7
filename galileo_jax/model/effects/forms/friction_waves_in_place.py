"""Friction that waves along the path, as over planks or a thread.

    k(q) = max(0, k + A cos(2 pi q / length) + B sin(2 pi q / length))    for every object

A = friction_waves_in_place, B = friction_waves_in_place_later, q along the path.
"""

import math

from galileo_jax.model.effects import LogNormal, Normal, Parameter, not_negative
from galileo_jax.model.effects.forms.form import Form

AHEAD = math.pi / 2  # the cosine as a sine: XLA computes it three times as fast
PRIOR = Normal(0.0, 0.1)
LENGTH_PRIOR = LogNormal(median=0.2, sd=0.7)


class FrictionWavesInPlace(Form, where=lambda scene: scene.has_surface):
    name = "friction_waves_in_place"
    meaning = "friction that goes up and down along the path"
    family = "wave_q"
    unknowns = (
        Parameter(name, "1", PRIOR, 0.0, "effect", 0.1),
        Parameter(f"{name}_later", "1", PRIOR, 0.0, "effect", 0.1),
        Parameter(f"{name}_length", "m", LENGTH_PRIOR, LENGTH_PRIOR.median, "effect", 0.1),
    )

    def friction(self, theta, scene):
        first, later = theta[self.name][..., None], theta[f"{self.name}_later"][..., None]
        rate = (2 * math.pi / theta[f"{self.name}_length"])[..., None]

        def law(state, k):
            xp = k.__array_namespace__()
            phase = rate * state.path_m
            wave = first * xp.sin(phase + AHEAD) + later * xp.sin(phase)
            return not_negative(k + wave)

        return law

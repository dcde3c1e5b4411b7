"""A force that comes and goes, as on a table that shakes.

    a(t) = A cos(2 pi t / period) + B sin(2 pi t / period)    for every object,    F = m a

A = force_waves_in_time, B = force_waves_in_time_later.
"""

import math

from galileo_jax.model.effects import LogNormal, Normal, Parameter
from galileo_jax.model.effects.forms.form import Form

AHEAD = math.pi / 2  # the cosine as a sine: XLA computes it three times as fast
PRIOR = Normal(0.0, 1.0)
PERIOD_PRIOR = LogNormal(median=0.2, sd=0.7)


class ForceWavesInTime(Form):
    name = "force_waves_in_time"
    meaning = "a force that oscillates in time"
    family = "wave_t"
    nature = "push"
    unknowns = (
        Parameter(name, "m/s^2", PRIOR, 0.0, "effect", 0.1, per_clip=True),
        Parameter(f"{name}_later", "m/s^2", PRIOR, 0.0, "effect", 0.1, per_clip=True),
        Parameter(f"{name}_period", "s", PERIOD_PRIOR, PERIOD_PRIOR.median, "effect", 0.1),
    )

    def force(self, theta, scene):
        first, later = theta[self.name], theta[f"{self.name}_later"]
        rate = 2 * math.pi / theta[f"{self.name}_period"]
        xp = first.__array_namespace__()
        mass = xp.stack(scene.mass(theta), axis=-1)

        def wave(state):
            phase = rate * state.time_s
            return mass * (first * xp.sin(phase + AHEAD) + later * xp.sin(phase))[..., None]

        return wave

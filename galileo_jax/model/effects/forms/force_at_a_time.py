"""A push or pull on object 1 at one moment, whatever it is and wherever it happens.

a(t) = force_at_a_time exp(-((t - moment) / duration)^2),    F = m a
"""

import math

from galileo_jax.model.effects import LogNormal, Normal, Parameter, Uniform
from galileo_jax.model.effects.forms.form import Form

PRIOR = Normal(0.0, 2.0)
DURATION_PRIOR = LogNormal(median=0.08, sd=0.7)
LAST_FALLS = 6.0  # moments are looked for until so many times the free fall through the start's way
LEAST_WAY_M = 0.2


class ForceAtATime(Form):
    name = "force_at_a_time"
    meaning = "a push or pull on object 1 at one moment"
    family = "pulse_t"
    nature = "push"
    is_on_all = False

    def parameters(self, scene):
        way = max(abs(scene.start_path_m[0]), LEAST_WAY_M)
        last = LAST_FALLS * math.sqrt(2 * way / scene.gravity)
        return tuple(
            Parameter(name, unit, prior, usual, "effect", 0.1, per_clip=True)
            for name, unit, prior, usual in (
                (self.name, "m/s^2", PRIOR, 0.0),
                (f"{self.name}_moment", "s", Uniform(0.0, last), last / 2),
                (f"{self.name}_duration", "s", DURATION_PRIOR, DURATION_PRIOR.median),
            )
        )

    def force(self, theta, scene):
        size = scene.only(theta[self.name] * theta["m1"], 0)
        moment, duration = theta[f"{self.name}_moment"], theta[f"{self.name}_duration"]
        exp = size.__array_namespace__().exp
        return lambda state: size * exp(-(((state.time_s - moment) / duration) ** 2))[..., None]

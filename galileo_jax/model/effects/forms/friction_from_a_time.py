"""Friction that changes at one moment and stays changed, as a surface that has dried or is wetted.

k(t) = max(0, k + friction_from_a_time (1 + tanh((t - moment) / 20 ms)) / 2)    for object 1

In a single passage a moment is a place: this does what a patch of friction does that is longer
than the rest of the way.
"""

import math

from galileo_jax.model.effects import Normal, Parameter, Uniform, not_negative
from galileo_jax.model.effects.forms.force_at_a_time import LAST_FALLS, LEAST_WAY_M
from galileo_jax.model.effects.forms.form import Form

PRIOR = Normal(0.0, 0.2)  # as of a patch
EDGE_S = 0.02


class FrictionFromATime(Form, where=lambda scene: scene.has_surface):
    name = "friction_from_a_time"
    meaning = "friction of object 1 that changes at one moment"
    family = "step_t"
    is_on_all = False

    def parameters(self, scene):
        way = max(abs(scene.start_path_m[0]), LEAST_WAY_M)
        last = LAST_FALLS * math.sqrt(2 * way / scene.gravity)
        moment = Uniform(0.0, last)
        return (
            Parameter(self.name, "1", PRIOR, 0.0, "effect", 0.05, per_clip=True),
            Parameter(f"{self.name}_moment", "s", moment, last / 2, "effect", 0.1, per_clip=True),
        )

    def friction(self, theta, scene):
        rougher = scene.only(theta[self.name], 0)
        moment = theta[f"{self.name}_moment"][..., None]
        tanh = moment.__array_namespace__().tanh
        return lambda state, k: not_negative(
            k + rougher * (0.5 * (1.0 + tanh((state.time_s - moment) / EDGE_S)))
        )

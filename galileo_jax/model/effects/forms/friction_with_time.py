"""Friction that grows or falls steadily with time, as surfaces that warm up.

k(t) = max(0, k (1 + friction_with_time t))    for every object, t since the release
"""

from galileo_jax.model.effects import Normal, Parameter
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.effects.law import changed_friction


class FrictionWithTime(Form, where=lambda scene: scene.has_surface):
    name = "friction_with_time"
    meaning = "friction that grows or falls with time"
    family = "power_t"
    unknowns = (Parameter(name, "1/s", Normal(0.0, 1.0), 0.0, "effect", 0.1),)

    def friction(self, theta, scene):
        share = theta[self.name][..., None]
        return lambda state, k: changed_friction(k, share * state.time_s)

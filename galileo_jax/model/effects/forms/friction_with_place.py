"""Friction that grows or falls steadily along the path, as on a surface less and less polished.

k(q) = max(0, k (1 + friction_with_place q))    for every object, q along the path
"""

from galileo_jax.model.effects import Normal, Parameter
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.effects.law import changed_friction


class FrictionWithPlace(Form, where=lambda scene: scene.has_surface):
    name = "friction_with_place"
    meaning = "friction that grows or falls along the path"
    family = "linear_q"
    unknowns = (Parameter(name, "1/m", Normal(0.0, 1.0), 0.0, "effect", 0.1),)

    def friction(self, theta, scene):
        share = theta[self.name][..., None]
        return lambda state, k: changed_friction(k, share * state.path_m)

"""Friction that grows or falls steadily along the path, as on a surface less and less polished.

k(q) = max(0, k (1 + friction_with_place q))    for every object, q along the path
"""

from galileo_jax.model.effects.effect import Array, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 1.0)


class FrictionWithPlace(Form, where=lambda scene: scene.has_surface):
    """Coefficients of all objects that change along the path."""

    name = "friction_with_place"
    meaning = "friction that grows or falls along the path"
    family = "linear_q"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """By which share per metre; none in a fall."""
        return (Parameter(self.name, "1/m", PRIOR, 0.0, "effect", 0.1),)

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the places."""
        share = theta[self.name][..., None]

        def law(state: State, k: Array) -> Array:
            return k.__array_namespace__().maximum(k * (1.0 + share * state.path_m), 0.0 * k)

        return law

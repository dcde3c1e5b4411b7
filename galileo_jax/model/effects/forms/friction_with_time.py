"""Friction that grows or falls steadily with time, as surfaces that warm up.

k(t) = max(0, k (1 + friction_with_time t))    for every object, t since the release
"""

from galileo_jax.model.effects.effect import Array, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 1.0)


class FrictionWithTime(Form, where=lambda scene: scene.has_surface):
    """Coefficients of all objects that change with time."""

    name = "friction_with_time"
    meaning = "friction that grows or falls with time"
    family = "power_t"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """By which share per second; none in a fall."""
        return (Parameter(self.name, "1/s", PRIOR, 0.0, "effect", 0.1),)

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the time."""
        share = theta[self.name][..., None]

        def law(state: State, k: Array) -> Array:
            return k.__array_namespace__().maximum(k * (1.0 + share * state.time_s), 0.0 * k)

        return law

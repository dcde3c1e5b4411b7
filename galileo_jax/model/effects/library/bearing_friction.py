"""Bearing friction: a pendulum's pivot rubs dry.

    F = -k (m g cos a + m v^2 / L) sign(v),    k = mu r / L

along the bob's circle; mu: the bearing's coefficient of friction, r: its radius. Swings shrink by
the same angle each time, 4 k a period while angles are small, and end at rest off the vertical.

Source: Squire (1986), Pendulum damping, Am. J. Phys. 54, 984.
Confused with: viscous_drag in a clip of a few swings of nearly the same size.
"""

from galileo_jax.model.effects.effect import (
    PENDULUM,
    Array,
    Effect,
    Friction,
    State,
    Surroundings,
    Theta,
)
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.005, sd=1.0)


@register
class BearingFriction(Effect, where=lambda scene: PENDULUM in scene.laws):
    """Dry friction in a pendulum's bearing."""

    name = "bearing_friction"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The coefficient k; none but for a pendulum."""
        return (Parameter("bearing_friction", "1", PRIOR, 0.0, "effect", 0.1),)

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficient."""
        own = theta["bearing_friction"][..., None]

        def law(state: State, k: Array) -> Array:
            return k + own

        return law

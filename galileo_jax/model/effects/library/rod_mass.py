"""Rod mass: a pendulum's rod is not without mass.

    (1 + u / 3) L a'' = -(1 + u / 2) g sin a,    u: the rod's mass over the bob's

for an even rod from the pivot to the bob's centre: it swings faster than a bob on a thread.

Source: Taylor, Classical Mechanics (2005), section 10.2 (a rod about its end: M L^2 / 3).
Confused with: scale_error, frame_rate: each of them acts like another gravity.
"""

from galileo_jax.model.effects.effect import (
    PENDULUM,
    Array,
    Effect,
    Force,
    State,
    Surroundings,
    Theta,
)
from galileo_jax.model.effects.laws.pendulum import LENGTH
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.3, sd=0.7)


@register
class RodMass(Effect, where=lambda scene: PENDULUM in scene.laws):
    """The rod of a pendulum has a mass."""

    name = "rod_mass"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The ratio of the masses; none but for a pendulum."""
        return (Parameter("rod_mass", "1", PRIOR, 0.0, "effect", 0.1),)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The rod's weight, at its middle."""
        weight = (0.5 * theta["rod_mass"] * theta["m1"] * scene.gravity)[..., None]
        length = theta[LENGTH][..., None]

        def pull(state: State):
            return -weight * weight.__array_namespace__().sin(state.path_m / length)

        return pull

    def inertia(self, theta: Theta, scene: Surroundings) -> Array:
        """The rod's."""
        return theta["rod_mass"][..., None] / 3

"""Constant force: something pulls object 1 along its path all the time.

    F = constant_force

downhill and away from the ramp positive: a wind, a thread over a pulley, a fan on a cart.

Source: Newton, Principia, law II (1687).
Confused with: k1, entirely where there is one slope: k_1 -> k_1 - F / (m g cos a) moves alike.
Ramp and table together tell them apart by 1 - cos a only; a body at rest, or one that comes
back up, does better.
"""

from typing import ClassVar

from galileo_jax.model.effects.effect import Effect, Force, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 0.5)


@register
class ConstantForce(Effect):
    """A steady force on object 1."""

    name: ClassVar[str] = "constant_force"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The force."""
        return (Parameter("constant_force", "N", PRIOR, 0.0, "effect", 0.05),)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force, everywhere the same."""
        pull = scene.only(theta["constant_force"], 0)

        def steady(state: State):
            return pull

        return steady

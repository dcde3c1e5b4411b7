"""Viscous drag: a resistance that grows in proportion to the speed.

    F = -b v

on every object: a film of oil, slow motion in air or water.

Source: Stokes, On the effect of the internal friction of fluids on the motion of pendulums
(1851); Taylor, Classical Mechanics (2005), section 2.2.
Confused with: air_drag where speeds span little; magnetic_brake where its zone is the whole path.
"""

from galileo_jax.model.effects.air import expected_odds
from galileo_jax.model.effects.effect import Effect, Force, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.3, sd=1.2)
# Of the size of the air's on a ball at 10 m/s.
FALL_PRIOR = LogNormal(median=0.03, sd=1.5)


@register
class ViscousDrag(Effect):
    """Drag on all objects, linear in the speed."""

    name = "viscous_drag"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The drag constant b."""
        prior = PRIOR if scene.has_surface else FALL_PRIOR
        return (Parameter("viscous_drag", "kg/s", prior, 0.0, "effect", 0.1),)

    def odds(self, theta: Theta, scene: Surroundings) -> float:
        """A little higher where it is of the size of the air's on a ball of known size."""
        return expected_odds(self.name, theta, scene, FALL_PRIOR)

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force -b v."""
        constant = theta["viscous_drag"][..., None]

        def drag(state: State):
            return -constant * state.speed_m_s

        return drag

"""Viscous drag: a resistance that grows in proportion to the speed.

    F = -b v

on every object: a film of oil, slow motion in air or water.

Source: Stokes, On the effect of the internal friction of fluids on the motion of pendulums
(1851); Taylor, Classical Mechanics (2005), section 2.2.
Confused with: air_drag where speeds span little; magnetic_brake where its zone is the whole path.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register
from galileo_jax.model.effects.air import expected_odds

PRIOR = LogNormal(median=0.3, sd=1.2)
# Of the size of the air's on a ball at 10 m/s.
FALL_PRIOR = LogNormal(median=0.03, sd=1.5)
# Of balls of 3 to 30 mm in anything from water to glycerine: b / m = 9 mu / (2 rho r^2).
LIQUID_PRIOR = LogNormal(median=0.5, sd=2.0)


@register
class ViscousDrag(Effect):
    name = "viscous_drag"

    def parameters(self, scene):
        in_liquid = "liquid" in scene.laws
        prior = PRIOR if scene.has_surface else LIQUID_PRIOR if in_liquid else FALL_PRIOR
        return (Parameter("viscous_drag", "kg/s", prior, 0.0, "effect", 0.1),)

    def odds(self, theta, scene):
        return expected_odds(self.name, theta, scene, FALL_PRIOR)

    def force(self, theta, scene):
        constant = theta["viscous_drag"][..., None]
        return lambda state: -constant * state.speed_m_s

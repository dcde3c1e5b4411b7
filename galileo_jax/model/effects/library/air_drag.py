"""Air drag: the resistance of the air, growing with the square of the speed.

    F = -c v |v|,    c = C_d rho A / 2

on every object. Holds at Reynolds numbers above some 1000 (a hand-sized object from 0.2 m/s
on). A 6 cm box has c = 0.002 kg/m: a sail or a light ball is needed to see it.

Source: Newton, Principia, book II (1687); Taylor, Classical Mechanics (2005), section 2.4.
Confused with: viscous_drag where speeds span less than a factor of two or so; a larger
friction k where they hardly change.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register
from galileo_jax.model.effects.air import expected_odds

PRIOR = LogNormal(median=0.3, sd=1.2)
# A ball: 3e-4 (table tennis, golf) to 0.015 (basketball).
FALL_PRIOR = LogNormal(median=0.003, sd=1.5)


@register
class AirDrag(Effect):
    name = "air_drag"

    def parameters(self, scene):
        prior = PRIOR if scene.has_surface else FALL_PRIOR
        return (Parameter("air_drag", "kg/m", prior, 0.0, "effect", 0.1),)

    def odds(self, theta, scene):
        return expected_odds(self.name, theta, scene, FALL_PRIOR)

    def force(self, theta, scene):
        constant = theta["air_drag"][..., None]
        return lambda state: -constant * state.speed_m_s * abs(state.speed_m_s)

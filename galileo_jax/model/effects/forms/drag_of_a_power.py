"""A resistance that grows with any power of the speed, not that of oil (1) or of air (2).

F = -drag_of_a_power (|v| / V)^power sign(v)    on every object; V = 1 m/s, in a fall 10 m/s
"""

from types import MappingProxyType

from galileo_jax.model.effects import LogNormal, Parameter, Uniform
from galileo_jax.model.effects.forms.form import Form

# The sizes that the drags of the library have.
PRIOR, FALL_PRIOR = LogNormal(median=0.3, sd=1.2), LogNormal(median=0.3, sd=1.5)
USUAL_M_S, USUAL_FALL_M_S = 1.0, 10.0
# Below a quarter it is friction.
POWER_PRIOR, USUAL_POWER = Uniform(0.25, 3.0), 1.0
SMALL = 0.01  # of the usual speed: there the slope of a root ends


class DragOfAPower(Form):
    name = "drag_of_a_power"
    meaning = "a drag that grows with another power of the speed"
    family = "power_v"
    nature = "drag"
    how_likely = 0.05  # drags are well known: nearly all have a power with a name
    constant = "power"
    constant_words = "the power of the speed"
    named_values = MappingProxyType({"viscous_drag": 1.0, "air_drag": 2.0})

    def parameters(self, scene):
        prior = PRIOR if scene.has_surface else FALL_PRIOR
        power = f"{self.name}_power"
        return (
            Parameter(self.name, "N", prior, 0.0, "effect", 0.1),
            Parameter(power, "1", POWER_PRIOR, USUAL_POWER, "effect", 0.1),
        )

    def force(self, theta, scene):
        size = theta[self.name][..., None]
        beside_linear = (theta[f"{self.name}_power"][..., None] - 1.0) / 2
        usual = USUAL_M_S if scene.has_surface else USUAL_FALL_M_S

        def drag(state):
            share = state.speed_m_s / usual
            return -size * share * (share**2 + SMALL**2) ** beside_linear

        return drag

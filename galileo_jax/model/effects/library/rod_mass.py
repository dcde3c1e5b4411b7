"""Rod mass: a pendulum's rod is not without mass.

    (1 + u / 3) L a'' = -(1 + u / 2) g sin a,    u: the rod's mass over the bob's

for an even rod from the pivot to the bob's centre: it swings faster than a bob on a thread.

Source: Taylor, Classical Mechanics (2005), section 10.2 (a rod about its end: M L^2 / 3).
Confused with: scale_error, frame_rate: each of them acts like another gravity.
"""

from galileo_jax.model.effects import PENDULUM, Effect, LogNormal, Parameter, register
from galileo_jax.model.effects.laws.pendulum import LENGTH


@register
class RodMass(Effect, where=lambda scene: PENDULUM in scene.laws):
    name = "rod_mass"
    unknowns = (Parameter("rod_mass", "1", LogNormal(0.3, 0.7), 0.0, "effect", 0.1),)

    def force(self, theta, scene):
        weight = (0.5 * theta["rod_mass"] * theta["m1"] * scene.gravity)[..., None]
        length = theta[LENGTH][..., None]
        return lambda state: -weight * weight.__array_namespace__().sin(state.path_m / length)

    def inertia(self, theta, scene):
        return theta["rod_mass"][..., None] / 3

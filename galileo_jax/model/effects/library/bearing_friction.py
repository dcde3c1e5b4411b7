"""Bearing friction: a pendulum's pivot rubs dry.

    F = -k (m g cos a + m v^2 / L) sign(v),    k = mu r / L

along the bob's circle; mu: the bearing's coefficient of friction, r: its radius. Swings shrink by
the same angle each time, 4 k a period while angles are small, and end at rest off the vertical.

Source: Squire (1986), Pendulum damping, Am. J. Phys. 54, 984.
Confused with: viscous_drag in a clip of a few swings of nearly the same size.
"""

from galileo_jax.model.effects import PENDULUM, Effect, LogNormal, Parameter, register


@register
class BearingFriction(Effect, where=lambda scene: PENDULUM in scene.laws):
    name = "bearing_friction"
    unknowns = (Parameter("bearing_friction", "1", LogNormal(0.005, 1.0), 0.0, "effect", 0.1),)

    def friction(self, theta, scene):
        own = theta["bearing_friction"][..., None]
        return lambda state, k: k + own

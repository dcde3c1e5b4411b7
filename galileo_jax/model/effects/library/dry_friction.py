"""Dry friction: what swings on a spring rubs on its track, by an axle or a guide.

    F = -k m g sign(v)

against the spring; it holds the load where it turns back, if the spring pulls less. Swings shrink
by the same length each time, 4 k g / w^2 a period, and end at rest off the middle.

Source: Marchewka, Abbott, Beichner (2004), Oscillator damped by a constant-magnitude friction
force, Am. J. Phys. 72, 477.
Confused with: damping and viscous_drag in a clip of a few swings of nearly the same size.
"""

from galileo_jax.model.effects import SPRING, Effect, LogNormal, Parameter, register


@register
class DryFriction(Effect, where=lambda scene: SPRING in scene.laws):
    name = "dry_friction"
    unknowns = (Parameter("dry_friction", "1", LogNormal(0.005, 1.0), 0.0, "effect", 0.1),)

    def friction(self, theta, scene):
        own = theta["dry_friction"][..., None]
        return lambda state, k: k + own

"""Friction patch: a strip of the path is rougher (or smoother).

    k(q) = max(0, k + friction_patch)  for  start < q < start + length

of every object that slides over it (seen from above, where each object has a way of its own, of
object 1), q along the path, 0 at the foot; both edges are as soft as the body is long (`zone.py`).

Source: Coulomb, Théorie des machines simples (1785), with a coefficient that depends on the
place; the shape of the edges is ours.
Confused with: surface_friction where the strip begins at the foot and is long;
magnetic_brake where the speed hardly changes inside.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, not_negative, register
from galileo_jax.model.effects.zone import share_inside, zone_parameters


@register
class FrictionPatch(Effect, where=lambda scene: scene.has_surface):
    name = "friction_patch"

    def parameters(self, scene):
        strength = Parameter("friction_patch", "1", Normal(0.0, 0.2), 0.0, "effect", 0.05)
        return (strength, *zone_parameters(self.name, scene))

    def friction(self, theta, scene):
        rougher = theta["friction_patch"]
        rougher = scene.only(rougher, 0) if scene.is_level else rougher[..., None]
        return lambda state, k: not_negative(
            k + rougher * share_inside(state.path_m, self.name, theta)
        )

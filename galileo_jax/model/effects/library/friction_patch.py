"""Friction patch: a strip of the path is rougher (or smoother).

    k(q) = max(0, k + friction_patch)  for  start < q < start + length

of every object that slides over it (seen from above, where each object has a way of its own, of
object 1), q along the path, 0 at the foot; both edges are as soft as the body is long (`zone.py`).

Source: Coulomb, Théorie des machines simples (1785), with a coefficient that depends on the
place; the shape of the edges is ours.
Confused with: surface_friction where the strip begins at the foot and is long;
magnetic_brake where the speed hardly changes inside.
"""

from galileo_jax.model.effects.effect import Array, Effect, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.effects.zone import share_inside, zone_parameters
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 0.2)


@register
class FrictionPatch(Effect, where=lambda scene: scene.has_surface):
    """A strip of the way with another friction coefficient."""

    name = "friction_patch"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """How much rougher it is there, and the zone; none in a fall."""
        strength = Parameter("friction_patch", "1", PRIOR, 0.0, "effect", 0.05)
        return (strength, *zone_parameters(self.name, scene))

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the places."""
        rougher = theta["friction_patch"]
        rougher = scene.only(rougher, 0) if scene.is_level else rougher[..., None]

        def law(state: State, k: Array) -> Array:
            xp = k.__array_namespace__()
            inside = share_inside(state.path_m, self.name, theta)
            return xp.maximum(k + rougher * inside, xp.zeros_like(k))

        return law

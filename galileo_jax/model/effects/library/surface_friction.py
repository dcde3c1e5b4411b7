"""Surface friction: for object 1 the table is rougher (or smoother) than the ramp.

    k1(table) = max(0, k1 + surface_friction)

Source: Amontons (1699); Coulomb (1785): the coefficient belongs to the pair of surfaces.
Confused with: table_tilt; friction_patch from the foot on; in part constant_force.
"""

from galileo_jax.model.effects.effect import Array, Effect, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, 0.1)


@register
class SurfaceFriction(Effect, where=lambda scene: scene.has_table):
    """Object 1 has another friction coefficient on the table."""

    name = "surface_friction"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """How much rougher the table is; none without a table."""
        return (Parameter("surface_friction", "1", PRIOR, 0.0, "effect", 0.05),)

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the places."""
        rougher = scene.only(theta["surface_friction"], 0)

        def law(state: State, k: Array) -> Array:
            xp = k.__array_namespace__()
            on_table = xp.maximum(k + rougher, xp.zeros_like(k))
            return xp.where(state.is_on_ramp, k, on_table)

        return law

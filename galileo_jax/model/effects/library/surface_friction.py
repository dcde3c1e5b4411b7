"""Surface friction: for object 1 the table is rougher (or smoother) than the ramp.

    k1(table) = max(0, k1 + surface_friction)

Source: Amontons (1699); Coulomb (1785): the coefficient belongs to the pair of surfaces.
Confused with: table_tilt; friction_patch from the foot on; in part constant_force.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, not_negative, register


@register
class SurfaceFriction(Effect, where=lambda scene: scene.has_table):
    name = "surface_friction"
    unknowns = (Parameter("surface_friction", "1", Normal(0.0, 0.1), 0.0, "effect", 0.05),)

    def friction(self, theta, scene):
        rougher = scene.only(theta["surface_friction"], 0)
        xp = rougher.__array_namespace__()
        return lambda state, k: xp.where(state.is_on_ramp, k, not_negative(k + rougher))

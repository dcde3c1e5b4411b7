"""Liquid: buoyancy, drag, and the liquid that a body carries along.

    m (1 + ratio / 2) q'' = m g (1 - ratio) - c q' |q'|

ratio: density of the liquid over the object's. Half of the displaced liquid moves with a sphere
(other shapes carry more or less). The drag is that of Reynolds numbers above some 1000; slower
motion has the effect viscous_drag. Only c / m shows, c where the mass was weighed.

Closed form: q' = v tanh(a t / v) from rest, a = g (1 - ratio) / (1 + ratio / 2), terminal speed
v^2 = m g (1 - ratio) / c.

Source: Archimedes, On floating bodies; Poisson (1831), added mass; Batchelor, An Introduction to
Fluid Dynamics (1967), sections 5.11 and 6.8.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter

ADDED_MASS = 0.5  # of the displaced liquid's, for a sphere
# A ball of 1 to 5 cm in water: c = 0.2 rho A.
DRAG_PRIOR = LogNormal(median=0.1, sd=1.5)


class Liquid(Effect, where=lambda scene: "liquid" in scene.laws):
    name = "liquid"

    def parameters(self, scene):
        ratio = LogNormal(*scene.expected["density_ratio"])
        return (
            Parameter("density_ratio", "1", ratio, 0.0, "main", 0.05),
            Parameter("liquid_drag", "kg/m", DRAG_PRIOR, 0.0, "main", 0.1),
        )

    def force(self, theta, scene):
        lift = (theta["density_ratio"] * theta["m1"] * scene.gravity)[..., None]
        constant = theta["liquid_drag"][..., None]
        return lambda state: -lift - constant * state.speed_m_s * abs(state.speed_m_s)

    def inertia(self, theta, scene):
        return ADDED_MASS * theta["density_ratio"][..., None]

    def derived(self, theta, scene):
        pull = theta["m1"] * scene.gravity * abs(1.0 - theta["density_ratio"])
        return {"terminal_speed": ((pull / theta["liquid_drag"]) ** 0.5, "m/s")}

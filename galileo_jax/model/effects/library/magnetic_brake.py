"""Magnetic brake: eddy currents brake object 1 within a zone of its path.

    F = -b v  for  start < q < start + length

where the field fades over some distance (`zone.py`). The speed lost is the same however fast the
object comes: dv/dq = -b / m.

Source: Wiederick, Gauthier, Campbell, Rochon (1987), Magnetic braking: simple theory and
experiment, Am. J. Phys. 55, 500.
Confused with: friction_patch where the speed hardly changes inside; viscous_drag where the
zone is the whole path.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register
from galileo_jax.model.effects.zone import share_inside, zone_parameters


@register
class MagneticBrake(Effect, where=lambda scene: scene.has_surface):
    name = "magnetic_brake"

    def parameters(self, scene):
        strength = Parameter("magnetic_brake", "kg/s", LogNormal(1.0, 1.2), 0.0, "effect", 0.1)
        return (strength, *zone_parameters(self.name, scene))

    def force(self, theta, scene):
        constant = scene.only(theta["magnetic_brake"], 0)
        return lambda state: (
            -constant * state.speed_m_s * share_inside(state.path_m, self.name, theta)
        )

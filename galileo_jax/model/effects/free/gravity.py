"""Gravity: the acceleration of free fall is measured, not declared.

A fall or a flight of known scale and frame rate determines it. On a slope only
g (sin a - k cos a) shows: a level table after it, or slopes of several angles, separate g from
the friction k. Whatever scales lengths or times (`pixels_per_metre`, `scale_error`,
`frame_rate`) acts like another g.

Source: Galilei, Discorsi (1638), third day.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter
from galileo_jax.model.effects.free_quantities import register

PRIOR_SD = 0.2  # of the logarithm: 8.0 to 12.0 m/s^2 where 9.81 is declared


@register
class Gravity(Effect):
    name = "gravity"

    def parameters(self, scene):
        prior = LogNormal(scene.gravity, PRIOR_SD)
        return (Parameter("gravity", "m/s^2", prior, scene.gravity, "main", 0.05),)

    def gravity(self, theta, scene):
        return theta["gravity"]

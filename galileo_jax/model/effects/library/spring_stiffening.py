"""Spring stiffening: a spring or a rubber band that is no straight line.

    F = -m w^2 (q - rest) (1 + b (q - rest)^2),    w = 2 pi / period

b > 0: stiffer the farther it is from its rest, as coils that close and bands near their end are; b
< 0: softer, as bands in the middle. The period is that of small swings; one of amplitude A takes
1 - 3 b A^2 / 8 of it, to first order.

Source: Duffing, Erzwungene Schwingungen bei veraenderlicher Eigenfrequenz (1918); Landau and
Lifshitz, Mechanics (1976), section 28.
Confused with: a shorter period, in a clip of swings of nearly the same size.
"""

import math

from galileo_jax.model.effects import SPRING, Effect, Normal, Parameter, register

USUAL_WAY_M = 0.2  # of a swing that nobody has seen yet
SHARE_AT_END = 0.3  # of the stiffness, half of the way from the middle


@register
class SpringStiffening(Effect, where=lambda scene: SPRING in scene.laws):
    name = "spring_stiffening"

    def parameters(self, scene):
        prior = Normal(0.0, SHARE_AT_END / (0.5 * (scene.way_m or USUAL_WAY_M)) ** 2)
        return (Parameter("spring_stiffening", "1/m^2", prior, 0.0, "effect", 0.05),)

    def force(self, theta, scene):
        stiffness = theta["m1"][..., None] * (2 * math.pi / theta["period"][..., None]) ** 2
        cubic = stiffness * theta["spring_stiffening"][..., None]
        rest = theta["rest"][..., None]
        return lambda state: -cubic * (state.path_m - rest) ** 3

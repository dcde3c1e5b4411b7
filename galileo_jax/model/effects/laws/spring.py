"""Spring: Hooke's law about the place of rest, with damping in proportion to the speed.

    q'' = -w^2 (q - rest) - 2 damping q',    w = 2 pi / period

Gravity only sets where the rest is, so that neither it nor the mass nor the scale shows in the
period: the stiffness is w^2 m, and known where the mass was weighed.

Closed form: q = rest + exp(-d t) [(q0 - rest) cos(f t) + (v0 + d (q0 - rest)) sin(f t) / f],
f^2 = w^2 - d^2.

Source: Hooke, De potentia restitutiva (1678); Taylor, Classical Mechanics (2005), chapter 5.
"""

import math

from galileo_jax.model.effects import SPRING, Effect, LogNormal, Normal, Parameter

PERIOD = "period"


class Spring(Effect, where=lambda scene: SPRING in scene.laws):
    name = SPRING

    def parameters(self, scene):
        period, rest = LogNormal(*scene.expected[PERIOD]), Normal(*scene.expected["rest"])
        return (
            Parameter(PERIOD, "s", period, period.median, "main", 0.02),
            Parameter("damping", "1/s", LogNormal(0.1, 1.5), 0.0, "main", 0.1),
            Parameter("rest", "m", rest, 0.0, "main", 0.02, per_clip=True),
        )

    def force(self, theta, scene):
        mass = theta["m1"][..., None]
        stiffness = mass * (2 * math.pi / theta[PERIOD][..., None]) ** 2
        rubbing = 2 * mass * theta["damping"][..., None]
        rest, weight = theta["rest"][..., None], (theta["m1"] * scene.gravity)[..., None]
        return lambda state: -stiffness * (state.path_m - rest) - rubbing * state.speed_m_s - weight

    def derived(self, theta, scene):
        square = (2 * math.pi / theta[PERIOD]) ** 2
        return {
            "stiffness": (theta["m1"] * square, "N/m"),
            "stretch": (scene.gravity / square, "m"),
        }

"""Foot transition: how much speed a real edge keeps at the foot of the ramp.

A factor on the speed where the path bends.

    v+ = f v- max(0, cos a - k sin a)

A point mass keeps f = 1 (the impulse that turns the motion also brakes it); boxes of
MuJoCo and Bullet keep 1 to 4 % less, depending on angle and size, and so does a real edge.
A foot that is rounded, or bridged with tape, takes no speed: f = 1 / (cos a - k sin a).
Two standard deviations reach there, for a k half as large as the largest with which a
body slides down, tan a.
"""

import math

from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.parameters import Normal, Parameter

EDGE_SD = 0.05


class FootTransition(Effect, where=lambda scene: scene.has_table and any(scene.comes_down)):
    name = "foot_transition"

    def parameters(self, scene):
        sd = foot_sd(scene.angle_rad)
        return (Parameter("foot_transition", "1", Normal(1.0, sd), 1.0, "nuisance", 0.1),)

    def foot(self, theta, scene):
        return theta["foot_transition"]


def foot_sd(angle_rad: float) -> float:
    """How far the factor may be from that of a sharp edge, one standard deviation."""
    kept = math.cos(angle_rad) - 0.5 * math.tan(angle_rad) * math.sin(angle_rad)
    rounded = 1.0 / kept - 1.0 if kept > 0 else 1.0
    return math.hypot(EDGE_SD, 0.5 * min(rounded, 1.0))

"""Foot transition: how much speed a real edge keeps at the foot of the ramp.

A factor on the speed where the path bends.

    v+ = f v- max(0, cos a - k sin a)

A point mass keeps f = 1 (the impulse that turns the motion also brakes it); boxes of
MuJoCo and Bullet keep 1 to 4 % less, depending on angle and size, and so does a real edge.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter

SD = 0.05


class FootTransition(Effect, where=lambda scene: scene.has_table and any(scene.comes_down)):
    name = "foot_transition"
    unknowns = (Parameter("foot_transition", "1", Normal(1.0, SD), 1.0, "nuisance", 0.1),)

    def foot(self, theta, scene):
        return theta["foot_transition"]

"""Initial push: object 1 is not let go at rest but with a speed.

    v(0) = initial_push

along the path, downhill. Of a trial, not of the objects.

Source: kinematics; Kleppner and Kolenkow, An Introduction to Mechanics (1973), chapter 1.
Confused with: a release before the first frame (release_instant), where the first frames
are missing.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register

PRIOR = LogNormal(median=0.3, sd=1.0)


@register
class InitialPush(Effect, where=lambda scene: not scene.starts_moving):
    name = "initial_push"
    unknowns = (Parameter("initial_push", "m/s", PRIOR, 0.0, "effect", 0.1, per_clip=True),)

    def start_speed(self, theta, scene):
        return scene.only(theta["initial_push"], 0)

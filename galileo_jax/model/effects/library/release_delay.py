"""Release delay: the object is let go later than the clip says.

    t <- t - release_delay

The hand lets go after the first frame (the nuisance release_instant covers a third of a
frame only). Of a trial, not of the objects.

Source: kinematics; Brown and Cox (2009), Innovative uses of video analysis, Phys. Teach. 47,
145.
Confused with: static_friction (a late start); initial_push of the opposite sign.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register

PRIOR = LogNormal(median=0.15, sd=1.0)


@register
class ReleaseDelay(Effect, where=lambda scene: not scene.starts_moving):
    name = "release_delay"
    unknowns = (Parameter("release_delay", "s", PRIOR, 0.0, "effect", step=None, per_clip=True),)

    def time(self, time_s, theta, scene):
        return time_s - theta["release_delay"]

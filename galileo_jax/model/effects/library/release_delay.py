"""Release delay: the object is let go later than the clip says.

    t <- t - release_delay

The hand lets go after the first frame (the nuisance release_instant covers a third of a
frame only). Of a trial, not of the objects.

Source: kinematics; Brown and Cox (2009), Innovative uses of video analysis, Phys. Teach. 47,
145.
Confused with: static_friction (a late start); initial_push of the opposite sign.
"""

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.15, sd=1.0)


@register
class ReleaseDelay(Effect, where=lambda scene: not scene.starts_moving):
    """Object 1 is released later than in the first frame."""

    name = "release_delay"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The delay; no rollout depends on it. None where nothing is let go."""
        return (Parameter("release_delay", "s", PRIOR, 0.0, "effect", step=None, per_clip=True),)

    def time(self, time_s: Array, theta: Theta, scene: Surroundings) -> Array:
        """The time since the true release."""
        return time_s - theta["release_delay"]

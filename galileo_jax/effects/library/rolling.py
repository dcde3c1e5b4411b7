"""Rolling: object 1 rolls instead of sliding, and turning it takes a share of the force.

    m (1 + beta) q'' = F,    beta = J / (m r^2)

beta is 2/5 for a ball, 1/2 for a cylinder, 2/3 for a hollow ball, 1 for a ring; the
friction k is then the rolling resistance.

Source: Crawford (1996), Rolling and slipping down Galileo's inclined plane, Am. J. Phys. 64,
541; Kleppner and Kolenkow, An Introduction to Mechanics (1973), chapter 6.
Confused with: scale_error, frame_rate and a larger k on one slope; the table tells k from it,
the impact the mass.
"""

from typing import ClassVar

from galileo_jax.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.effects.registry import register
from galileo_jax.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.45, sd=0.4)


@register
class Rolling(Effect):
    """Inertia of object 1 beyond its mass."""

    name: ClassVar[str] = "rolling"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The share beta; none in a fall."""
        if not scene.has_surface:
            return ()
        return (Parameter("rolling", "1", PRIOR, 0.0, "effect", 0.1),)

    def inertia(self, theta: Theta, scene: Surroundings) -> Array | None:
        """The share, of object 1."""
        if not scene.has_surface:
            return None
        return scene.only(theta["rolling"], 0)

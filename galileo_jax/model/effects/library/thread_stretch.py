"""Thread stretch: a pendulum's thread gives way under its load.

    r = L + s T / (m g),    T = m g cos a + m v^2 / L

s: how far the bob's weight at rest stretches it. The thread follows its load at once; its own
vibrations (period 2 pi (s / g)^(1/2)) are not modelled, so that s must be small against L.

Source: Hooke, De potentia restitutiva (1678); Landau and Lifshitz, Mechanics (1976), section 5.
Confused with: a longer thread where swings are small and nobody declared its length.
"""

from galileo_jax.model.effects.effect import PENDULUM, Array, Effect, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.01, sd=0.7)


@register
class ThreadStretch(Effect, where=lambda scene: PENDULUM in scene.laws):
    """The thread of a pendulum stretches."""

    name = "thread_stretch"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The stretch by the weight; none but for a pendulum."""
        return (Parameter("thread_stretch", "m", PRIOR, 0.0, "effect", 0.1),)

    def stretch(self, theta: Theta, scene: Surroundings) -> Array:
        """How far."""
        return theta["thread_stretch"]

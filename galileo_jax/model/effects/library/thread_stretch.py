"""Thread stretch: a pendulum's thread gives way under its load.

    r = L + s T / (m g),    T = m g cos a + m v^2 / L

s: how far the bob's weight at rest stretches it. The thread follows its load at once; its own
vibrations (period 2 pi (s / g)^(1/2)) are not modelled, so that s must be small against L.

Source: Hooke, De potentia restitutiva (1678); Landau and Lifshitz, Mechanics (1976), section 5.
Confused with: a longer thread where swings are small and nobody declared its length.
"""

from galileo_jax.model.effects import PENDULUM, Effect, LogNormal, Parameter, register


@register
class ThreadStretch(Effect, where=lambda scene: PENDULUM in scene.laws):
    name = "thread_stretch"
    unknowns = (Parameter("thread_stretch", "m", LogNormal(0.01, 0.7), 0.0, "effect", 0.1),)

    def stretch(self, theta, scene):
        return theta["thread_stretch"]

"""A force that comes and goes, as on a table that shakes.

    a(t) = A cos(2 pi t / period) + B sin(2 pi t / period)    for every object,    F = m a

A = force_waves_in_time, B = force_waves_in_time_later.
"""

import math

from galileo_jax.model.effects.effect import Array, Force, State, Surroundings, Theta
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.parameters import LogNormal, Normal, Parameter

AHEAD = math.pi / 2  # the cosine as a sine: XLA computes it three times as fast
PRIOR = Normal(0.0, 1.0)
PERIOD_PRIOR = LogNormal(median=0.2, sd=0.7)


class ForceWavesInTime(Form):
    """An acceleration of all objects that waves in time."""

    name = "force_waves_in_time"
    meaning = "a force that oscillates in time"
    family = "wave_t"
    nature = "push"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """Two strengths, a quarter of a period apart, and the period."""
        usual = PERIOD_PRIOR.median
        return (
            Parameter(self.name, "m/s^2", PRIOR, 0.0, "effect", 0.1, per_clip=True),
            Parameter(f"{self.name}_later", "m/s^2", PRIOR, 0.0, "effect", 0.1, per_clip=True),
            Parameter(f"{self.name}_period", "s", PERIOD_PRIOR, usual, "effect", 0.1),
        )

    def force(self, theta: Theta, scene: Surroundings) -> Force:
        """The force at the time."""
        first, later = theta[self.name], theta[f"{self.name}_later"]
        rate = 2 * math.pi / theta[f"{self.name}_period"]
        xp = first.__array_namespace__()
        mass = xp.stack(scene.mass(theta), axis=-1)

        def wave(state: State) -> Array:
            phase = rate * state.time_s
            return mass * (first * xp.sin(phase + AHEAD) + later * xp.sin(phase))[..., None]

        return wave

"""Friction that changes at one moment and stays changed, as a surface that has dried or is wetted.

k(t) = max(0, k + friction_from_a_time (1 + tanh((t - moment) / 20 ms)) / 2)    for object 1

In a single passage a moment is a place: this does what a patch of friction does that is longer
than the rest of the way.
"""

import math

from galileo_jax.model.effects.effect import Array, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.forms.force_at_a_time import LAST_FALLS, LEAST_WAY_M
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.model.parameters import Normal, Parameter, Uniform

PRIOR = Normal(0.0, 0.2)  # as of a patch
EDGE_S = 0.02


class FrictionFromATime(Form, where=lambda scene: scene.has_surface):
    """Another coefficient of object 1 from one moment of each trial on."""

    name = "friction_from_a_time"
    meaning = "friction of object 1 that changes at one moment"
    family = "step_t"
    is_on_all = False

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """By how much, and when; none in a fall."""
        way = max(abs(scene.start_path_m[0]), LEAST_WAY_M)
        last = LAST_FALLS * math.sqrt(2 * way / scene.gravity)
        moment = Uniform(0.0, last)
        return (
            Parameter(self.name, "1", PRIOR, 0.0, "effect", 0.05, per_clip=True),
            Parameter(f"{self.name}_moment", "s", moment, last / 2, "effect", 0.1, per_clip=True),
        )

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the time."""
        rougher = scene.only(theta[self.name], 0)
        moment = theta[f"{self.name}_moment"][..., None]

        def law(state: State, k: Array) -> Array:
            xp = k.__array_namespace__()
            late = 0.5 * (1.0 + xp.tanh((state.time_s - moment) / EDGE_S))
            return xp.maximum(k + rougher * late, 0.0 * k)

        return law

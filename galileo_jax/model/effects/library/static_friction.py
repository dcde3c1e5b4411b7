"""Static friction: what rests, or nearly, holds on harder than what slides.

    k(v) = k + s exp(-(v / v_s)^2),    v_s = 0.02 m/s

on every object: a body rests on a ramp up to tan a = k + s, and a sliding one is caught at
the end. Above 0.05 m/s there is nothing of it, so that a body which sets off at once hardly
shows it.

Source: Coulomb, Théorie des machines simples (1785); Bo and Pavelescu (1982), Wear 82, 277,
the Gaussian fall.
Confused with: a larger k where all motion is slow; release_delay (a late start).
"""

from typing import ClassVar

from galileo_jax.model.effects.effect import Array, Effect, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=0.1, sd=1.0)
SLOW_M_S = 0.02


@register
class StaticFriction(Effect):
    """An extra coefficient at rest."""

    name: ClassVar[str] = "static_friction"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The extra coefficient s; none in a fall."""
        if not scene.has_surface:
            return ()
        return (Parameter("static_friction", "1", PRIOR, 0.0, "effect", 0.1),)

    def friction(self, theta: Theta, scene: Surroundings) -> Friction | None:
        """The coefficients at the speeds."""
        if not scene.has_surface:
            return None
        extra = theta["static_friction"][..., None]

        def law(state: State, k: Array) -> Array:
            xp = k.__array_namespace__()
            return k + extra * xp.exp(-((state.speed_m_s / SLOW_M_S) ** 2))

        return law

"""Stribeck friction: bodies rub more at low speed than at high.

    k(v) = k (1 + a exp(-|v| / v_s)),    a = stribeck, v_s = stribeck_speed

of every object, each with its own k. A film of grease or air carries the faster body; k is the
friction at high speed.

Source: Stribeck (1902), the fall of friction with speed; Tustin (1947), J. IEE 94 IIA, 143,
the exponential; Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30, 1083.
Confused with: a larger k where v_s is above all speeds; static_friction where it is far
below them; constant_force and air_drag in part (they change the acceleration with speed too).
"""

from galileo_jax.model.effects.effect import Array, Effect, Friction, State, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import LogNormal, Parameter

PRIOR = LogNormal(median=1.0, sd=1.0)
SPEED_PRIOR = LogNormal(median=0.4, sd=0.7)


@register
class Stribeck(Effect, where=lambda scene: scene.has_surface):
    """Friction falls with the speed."""

    name = "stribeck"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """How much more friction there is at low speed, and up to which; none in a fall."""
        usual = SPEED_PRIOR.median  # means nothing while the strength is absent
        return (
            Parameter("stribeck", "1", PRIOR, 0.0, "effect", 0.1),
            Parameter("stribeck_speed", "m/s", SPEED_PRIOR, usual, "effect", 0.1),
        )

    def friction(self, theta: Theta, scene: Surroundings) -> Friction:
        """The coefficients at the speeds."""
        excess = theta["stribeck"][..., None]
        speed = theta["stribeck_speed"][..., None]

        def law(state: State, k: Array) -> Array:
            xp = k.__array_namespace__()
            return k * (1.0 + excess * xp.exp(-abs(state.speed_m_s) / speed))

        return law

"""Stribeck friction: bodies rub more at low speed than at high.

    k(v) = k (1 + a exp(-|v| / v_s)),    a = stribeck, v_s = stribeck_speed

of every object, each with its own k. A film of grease or air carries the faster body; k is the
friction at high speed.

Source: Stribeck (1902), the fall of friction with speed; Tustin (1947), J. IEE 94 IIA, 143,
the exponential; Armstrong-Helouvry, Dupont, Canudas de Wit (1994), Automatica 30, 1083.
Confused with: a larger k where v_s is above all speeds; static_friction where it is far
below them; constant_force and air_drag in part (they change the acceleration with speed too).
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register

PRIOR = LogNormal(median=1.0, sd=1.0)
SPEED_PRIOR = LogNormal(median=0.4, sd=0.7)


@register
class Stribeck(Effect, where=lambda scene: scene.has_surface):
    name = "stribeck"
    unknowns = (
        Parameter("stribeck", "1", PRIOR, 0.0, "effect", 0.1),
        Parameter("stribeck_speed", "m/s", SPEED_PRIOR, SPEED_PRIOR.median, "effect", 0.1),
    )

    def friction(self, theta, scene):
        excess = theta["stribeck"][..., None]
        speed = theta["stribeck_speed"][..., None]
        xp = excess.__array_namespace__()
        return lambda state, k: k * (1.0 + excess * xp.exp(-abs(state.speed_m_s) / speed))

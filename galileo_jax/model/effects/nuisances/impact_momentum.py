"""Impact momentum: a hit of bodies does not conserve momentum along the table to the last digit.

A factor f on the momentum that a hit passes on.

    m_rear (v_rear - v_rear') f = m_front (v_front' - v_front)

The motion alone does not tell it from the ratio of the masses, which it makes less certain.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter

# Half a per cent of the impulse for either body. Faces rub and lift, and what hops has no friction:
# boxes of Bullet are off by 1.3 % (root mean square of 40).
SD = 0.007


class ImpactMomentum(Effect, where=lambda scene: len(scene.names) > 1 and not scene.is_level):
    name = "impact_momentum"

    def parameters(self, scene):
        return tuple(
            Parameter(f"impact_momentum_{name}", "1", Normal(1.0, SD), 1.0, "nuisance", 0.2)
            for name in scene.names[1:]
        )

    def passed_on(self, theta, scene):
        return tuple(theta[f"impact_momentum_{name}"] for name in scene.names[1:])

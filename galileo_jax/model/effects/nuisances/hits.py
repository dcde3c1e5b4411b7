"""Hits of bodies on a path: what no model knows of them but the rebound (`impact_restitution`).

Contact gap: a hit presses bodies together by the better part of a millimetre, which nobody tells
from a gap declared too large (`start_offset`), and it turns boxes that meet a little off their
centres: then a corner touches first. When friction brings them together again they touch further
apart. Taken for as close as at the hit, the second contact bends both coefficients of friction.

Impact momentum: a hit does not conserve momentum along the table to the last digit. The motion
alone does not tell the factor f from the ratio of the masses, which it makes less certain.

    m_rear (v_rear - v_rear') f = m_front (v_front' - v_front)
"""

from galileo_jax.model.effects import Effect, HalfNormal, Normal, Parameter, Surroundings

# Half of a box 60 mm deep, turned by some four degrees; what it travels at 1 m/s in the
# millisecond or two of a hit is as much.
GAP_PRIOR = HalfNormal(2e-3)
# Half a per cent of the impulse for either body. Faces rub and lift, and what hops has no friction:
# boxes of Bullet are off by 1.3 % (root mean square of 40).
MOMENTUM_SD = 0.007


def _can_hit(scene: Surroundings) -> bool:
    return len(scene.names) > 1 and not scene.is_level


class ContactGap(Effect, where=_can_hit):
    name = "contact_gap"
    unknowns = (Parameter("contact_gap", "m", GAP_PRIOR, 0.0, "nuisance", 0.2),)

    def overlap(self, theta, scene):
        return theta["contact_gap"]


class ImpactMomentum(Effect, where=_can_hit):
    name = "impact_momentum"

    def parameters(self, scene):
        prior = Normal(1.0, MOMENTUM_SD)
        return tuple(
            Parameter(f"impact_momentum_{name}", "1", prior, 1.0, "nuisance", 0.2)
            for name in scene.names[1:]
        )

    def passed_on(self, theta, scene):
        return tuple(theta[f"impact_momentum_{name}"] for name in scene.names[1:])

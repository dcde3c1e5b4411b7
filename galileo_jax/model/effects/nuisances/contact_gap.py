"""Contact gap: bodies that touch a second time do so further apart than when they met.

When friction brings bodies together again after a hit, they touch further apart.

A hit presses them together by the better part of a millimetre, which nobody tells from a gap
declared too large (`start_offset`), and it turns boxes that meet a little off their centres:
then a corner touches first. Taken for as close as at the hit, the second contact bends both
coefficients of friction.
"""

from galileo_jax.model.effects import Effect, HalfNormal, Parameter

# Half of a box 60 mm deep, turned by some four degrees; what it travels at 1 m/s in the
# millisecond or two of a hit is as much.
PRIOR = HalfNormal(2e-3)


class ContactGap(Effect, where=lambda scene: len(scene.names) > 1 and not scene.is_level):
    name = "contact_gap"
    unknowns = (Parameter("contact_gap", "m", PRIOR, 0.0, "nuisance", 0.2),)

    def overlap(self, theta, scene):
        return theta["contact_gap"]

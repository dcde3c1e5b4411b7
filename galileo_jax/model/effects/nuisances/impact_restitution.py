"""Impact restitution: no real impact is perfectly plastic.

A small coefficient of restitution between the objects.

Without it a rebound of a few per cent, which every body shows, is taken for a difference
of friction or mass.
"""

from galileo_jax.model.effects import Effect, HalfNormal, Parameter

# Some impacts are plastic to the last digit, most return about a hundredth; Bullet's boxes, told
# to be plastic, up to 0.05. More than a tenth is an effect with a name, restitution.
PRIOR = HalfNormal(0.04)


class ImpactRestitution(Effect, where=lambda scene: len(scene.names) > 1 and not scene.is_level):
    name = "impact_restitution"
    unknowns = (Parameter("impact_restitution", "1", PRIOR, 0.0, "nuisance", 0.2),)

    def restitution(self, theta, scene):
        return theta["impact_restitution"]

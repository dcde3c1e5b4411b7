"""Restitution: objects bounce off each other.

    v2' - v1' = e (v1 - v2)

e is what this effect adds to the nuisance impact_restitution (about 0.01). Impacts slower
than 0.02 m/s stay plastic.

Source: Newton, Principia, laws of motion, scholium (1687); Stronge, Impact Mechanics (2000).
Confused with: the mass ratio, where only object 2 is seen after the hit.
"""

from galileo_jax.model.effects import Effect, Parameter, Uniform, register


@register
class Restitution(Effect, where=lambda scene: len(scene.names) > 1):
    name = "restitution"
    unknowns = (Parameter("restitution", "1", Uniform(0.0, 1.0), 0.0, "effect", 0.1),)

    def restitution(self, theta, scene):
        return theta["restitution"]

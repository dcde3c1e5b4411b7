"""Rolling: object 1, declared to slide, rolls, and turning it takes a share of the force.

    m (1 + beta) q'' = F,    beta = J / (m r^2)

beta is 2/5 for a ball, 1/2 for a cylinder, 2/3 for a hollow ball, 1 for a ring; the
friction k is then the rolling resistance. It is the hypothesis that something turns; where the
clip declares that it does (`rolls`, or a sphere), the contact decides and the share is known, so
that the effect has no place. What is declared a box rolls only on wheels.

Source: Crawford (1996), Rolling and slipping down Galileo's inclined plane, Am. J. Phys. 64,
541; Kleppner and Kolenkow, An Introduction to Mechanics (1973), chapter 6.
Confused with: scale_error, frame_rate and a larger k on one slope; the table tells k from it,
the impact the mass.
"""

from galileo_jax.model.effects import Effect, LogNormal, Parameter, register

ON_WHEELS = 0.05  # odds that a box has some: a toy car, a cart


@register
class Rolling(Effect, where=lambda scene: scene.has_surface and not any(scene.rolls[:1])):
    name = "rolling"
    unknowns = (Parameter("rolling", "1", LogNormal(0.45, 0.4), 0.0, "effect", 0.1),)

    def odds(self, theta, scene):
        return ON_WHEELS if any(scene.is_box[:1]) else 1.0

    def inertia(self, theta, scene):
        return scene.only(theta["rolling"], 0)

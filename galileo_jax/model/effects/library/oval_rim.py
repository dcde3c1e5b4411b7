"""Oval rim: a puck that is seen from above is not round.

    h(a) = r (1 + c cos 2 (a - turned) + s sin 2 (a - turned))

is how far its rim reaches in the direction a from its middle, c and s when it is first seen. A hit
then pushes beside the middle, by h' = dh/da: it turns pucks without any grip, and sends them off
beside the line of their middles.

Closed form: an impulse P without grip turns a disc of mass m by m r^2 w / 2 = h' P.

Source: Santaló, Integral Geometry and Geometric Probability (1976), chapter 1 (support functions);
Chatterjee and Ruina (1998), A new algebraic rigid-body collision law, J. Appl. Mech. 65, 939.
Confused with: grip, and where exactly the pucks meet (nuisance `hit_offset`), in a single hit.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, Surroundings, by_object, register

PARTS = ("oval_rim_c", "oval_rim_s")
PRIOR = Normal(0.0, 0.03)  # of a radius: a seam, a dent, a puck cut by hand


def _can_meet(scene: Surroundings) -> bool:
    """Whether pucks have each other, or a wall, to meet."""
    return scene.is_level and (len(scene.names) > 1 or len(scene.walls_m) > 0)


@register
class OvalRim(Effect, where=_can_meet):
    name = "oval_rim"

    def parameters(self, scene):
        return tuple(
            Parameter(name, "1", PRIOR, 0.0, "effect", 0.05, per_clip=True)
            for own in scene.numbered(*PARTS)
            for name in own
        )

    def oval(self, theta, scene):
        return by_object(theta, scene.numbered(*PARTS))

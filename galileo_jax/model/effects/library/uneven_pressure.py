"""Uneven pressure: a puck presses on the table beside its middle.

    u = v + w x c,    W = (u, r w / sqrt(2)),    F = -k m g u / |W|
    moment about the middle = c x F - k m g r^2 w / (2 |W|)

c: the centre of the pressure, fixed in the puck, so that it goes round with it; as shares of the
radius r along x and y of the track when the puck is first seen. It is the friction of
`laws/pucks.py` with its centre at c in place of the middle: what slides without turning is turned
until c trails behind the middle. Friction takes k m g |W| of the energy per second.

Closed form: where c is across the way of a puck that does not turn, w' = 2 k g c / r^2; where it is
ahead or behind, none.

Source: Howe and Cutkosky (1996), Practical force-motion models for sliding manipulation, Int. J.
Robotics Res. 15, 557 (a limit surface about the centre of pressure).
Confused with: nothing where the turning is in the data; else hardly seen at all.
"""

from galileo_jax.model.effects import Effect, Normal, Parameter, by_object, register

AXES = ("uneven_pressure_x", "uneven_pressure_y")
PRIOR = Normal(0.0, 0.15)  # of a radius: a felt or a burr on one side


@register
class UnevenPressure(Effect, where=lambda scene: scene.is_level):
    name = "uneven_pressure"

    def parameters(self, scene):
        return tuple(
            Parameter(name, "1", PRIOR, 0.0, "effect", 0.05, per_clip=True)
            for own in scene.numbered(*AXES)
            for name in own
        )

    def pressure(self, theta, scene):
        return by_object(theta, scene.numbered(*AXES))

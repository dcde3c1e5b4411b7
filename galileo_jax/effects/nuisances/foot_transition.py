"""Foot transition: how much speed a real edge keeps at the foot of the ramp."""

import math
from typing import ClassVar

from galileo_jax.effects.effect import Array, Effect, Force, State, Surroundings, Theta
from galileo_jax.parameters import Normal, Parameter

SD = 0.05
ZONE_M = 0.03  # of the size of an object, which takes so long to cross the edge


class FootTransition(Effect):
    """A short zone of drag (or thrust) just past the foot.

    F = m ln(f) w(x) v |v|,   w a raised cosine over the zone with integral 1,

    so that dv/dx = ln(f) w(x) v and an object that crosses the zone leaves it with f times
    the speed, whatever its speed. A point mass keeps v (cos a - k sin a) at the foot, f = 1;
    boxes of MuJoCo and Bullet keep 1 to 4 % less, depending on angle and size, and so does a
    real edge.
    """

    name: ClassVar[str] = "foot_transition"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The factor on the speed."""
        if scene.angle_rad == 0.0 or scene.corner_m[0] == float("inf"):
            return ()
        return (Parameter("foot_transition", "1", Normal(1.0, SD), 1.0, "nuisance", 0.1),)

    def force(self, theta: Theta, scene: Surroundings) -> Force | None:
        """The zone's drag on whatever comes down the ramp."""
        if not self.parameters(scene):
            return None
        factor = theta["foot_transition"]
        xp = factor.__array_namespace__()
        came_down = [x < c for (x, _), c in zip(scene.start_m, scene.corner_m, strict=True)]
        logarithm = xp.log(xp.clip(factor, 0.5, 2.0)) / ZONE_M
        scale = xp.stack(
            [m * logarithm * down for m, down in zip(scene.mass(theta), came_down, strict=True)],
            axis=-1,
        )
        begin = xp.asarray(scene.corner_m)
        along_x = xp.asarray([1.0, 0.0])

        def drag(state: State) -> Array:
            share = xp.clip((state.position_m[..., 0] - begin) / ZONE_M, 0.0, 1.0)
            speed = state.velocity_m_s[..., 0]
            force = scale * (1 - xp.cos(2 * math.pi * share)) * speed * abs(speed)
            return force[..., None] * along_x

        return drag

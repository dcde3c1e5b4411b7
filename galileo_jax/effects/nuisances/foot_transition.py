"""Foot transition: how much speed a real edge keeps at the foot of the ramp."""

from typing import ClassVar

from galileo_jax.effects.effect import Array, Effect, State, Surroundings, Theta
from galileo_jax.parameters import Normal, Parameter

SD = 0.05
ZONE_M = 0.03  # of the size of an object, which takes so long to cross the edge


class FootTransition(Effect):
    """A short zone of drag (or thrust) just past the foot.

    F = m ln(f) w(x) v,   w a raised cosine over the zone with integral 1,

    so that dv/dx = ln(f) w(x) and an object that crosses the zone leaves it with f times
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

    def force(self, state: State, theta: Theta, scene: Surroundings) -> Array | None:
        """The zone's drag on whatever comes down the ramp."""
        if not self.parameters(scene):
            return None
        x, v = state.position_m[..., 0], state.velocity_m_s[..., 0]
        xp = x.__array_namespace__()
        corner = xp.asarray(scene.corner_m)
        came_down = xp.asarray(
            [start < c for (start, _), c in zip(scene.start_m, scene.corner_m, strict=True)]
        )
        share = xp.clip((x - corner) / ZONE_M, 0.0, 1.0)
        weight = (1 - xp.cos(2 * xp.pi * share)) / ZONE_M
        mass = xp.stack(scene.mass(theta), axis=-1)
        factor = xp.clip(theta["foot_transition"], 0.5, 2.0)
        drag = mass * xp.log(factor)[..., None] * weight * v * came_down
        return xp.stack([drag, xp.zeros_like(drag)], axis=-1)

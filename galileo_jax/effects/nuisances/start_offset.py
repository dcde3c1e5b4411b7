"""Start offset: each object starts a few millimetres from where it was marked."""

from typing import ClassVar

from galileo_jax.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.parameters import Normal, Parameter

SD_M = 0.003  # a point set by hand, sizes told to a millimetre


class StartOffset(Effect):
    """Moves each start along the object's path, downhill positive.

    start(i) <- start(i) + offset_i t_i,   t_i = the surface's direction under object i.

    For object 1 it is the distance to the foot, for the others the gap before they are hit.
    """

    name: ClassVar[str] = "start_offset"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """One per object, m."""
        if scene.angle_rad == 0.0 or scene.corner_m[0] == float("inf"):
            return ()
        return tuple(
            Parameter(f"start_offset_{name}", "m", Normal(0.0, SD_M), 0.0, "nuisance", 0.15)
            for name in scene.names
        )

    def start(self, position_m: Array, theta: Theta, scene: Surroundings) -> Array:
        """Moves every centre along its surface."""
        if not self.parameters(scene):
            return position_m
        xp = position_m.__array_namespace__()
        offset = xp.stack([theta[f"start_offset_{name}"] for name in scene.names], axis=-1)
        on_ramp = xp.asarray(
            [x < c for (x, _), c in zip(scene.start_m, scene.corner_m, strict=True)]
        )
        angle = xp.where(on_ramp, scene.angle_rad, 0.0)
        direction = xp.stack([xp.cos(angle), -xp.sin(angle)], axis=-1)
        return position_m + offset[..., None] * direction

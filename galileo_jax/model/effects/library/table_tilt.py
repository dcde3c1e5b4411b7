"""Table tilt: the table is not level.

    q'' = g (sin b - k cos b)  on the table,    b = table_tilt

positive where it falls away from the ramp. Of a table seen from above: towards x, and as
`table_tilt_y` towards y.

Source: Galileo, Discorsi, third day (1638).
Confused with: surface_friction (k1 on the table) where object 2 is not moved; both
frictions on the table, where both objects move: only the direction in the picture (y) tells.
"""

import math
from dataclasses import replace

from galileo_jax.model.effects.effect import Array, Effect, Surroundings, Theta
from galileo_jax.model.effects.registry import register
from galileo_jax.model.parameters import Normal, Parameter

PRIOR = Normal(0.0, math.radians(1.5))


@register
class TableTilt(Effect, where=lambda scene: scene.has_table or scene.is_level):
    """The table is not level."""

    name = "table_tilt"

    def parameters(self, scene: Surroundings) -> tuple[Parameter, ...]:
        """The table's slope, from above both; none without a table."""
        tilt = Parameter("table_tilt", "rad", PRIOR, 0.0, "effect", 0.05)
        if scene.is_level:
            return (tilt, replace(tilt, name="table_tilt_y"))
        return (tilt,)

    def tilt(self, theta: Theta, scene: Surroundings) -> tuple[Array, Array]:
        """Of the table alone."""
        slope = theta["table_tilt"]
        if scene.is_level:
            return slope, theta["table_tilt_y"]
        return 0.0 * slope, slope

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

from galileo_jax.model.effects import Effect, Normal, Parameter, register


@register
class TableTilt(Effect, where=lambda scene: scene.has_table or scene.is_level):
    name = "table_tilt"

    def parameters(self, scene):
        tilt = Parameter("table_tilt", "rad", Normal(0.0, math.radians(1.5)), 0.0, "effect", 0.05)
        if scene.is_level:
            return (tilt, replace(tilt, name="table_tilt_y"))
        return (tilt,)

    def tilt(self, theta, scene):
        slope = theta["table_tilt"]
        if scene.is_level:
            return slope, theta["table_tilt_y"]
        return 0.0 * slope, slope

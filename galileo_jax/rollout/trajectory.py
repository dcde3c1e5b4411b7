"""A trajectory: where the model says the objects are, densely in time."""

from typing import NamedTuple

import jax


class Trajectory(NamedTuple):
    """Simulated motion of all objects' centres on the engine's own time grid.

    Leading batch axes are allowed before the axes named here.

    Attributes:
      times_s: `[step]`, s since the release, evenly spaced.
      position_m: `[object, 2, step]`, m; x along the travel, y up, origin at the foot.
      velocity_m_s: `[object, 2, step]`, m/s.
    """

    times_s: jax.Array
    position_m: jax.Array
    velocity_m_s: jax.Array

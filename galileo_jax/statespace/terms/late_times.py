"""Times that are off at random, of each frame by another amount: they shift bodies by v dt.

Clocks of phones, times printed in milliseconds, pictures that were exposed for long.
"""

import numpy as np

from galileo_jax.statespace.kinematics import velocities
from galileo_jax.statespace.term import Patterns, Seen, term


def _median_s(seen: Seen) -> float:
    times = seen.observation.times_s
    return 0.01 * (float(np.median(np.diff(times))) if len(times) > 1 else 1.0)


@term("late_times", "times are off by {size} at random", "s", _median_s, 4.0, is_of_marks=True)
def late_times(seen: Seen) -> Patterns:
    """Of each frame on its own; none of what rests."""
    velocity = velocities(seen.observation)
    shifts = np.einsum("oat,tk->koat", velocity, np.eye(velocity.shape[-1]))
    return shifts[np.abs(shifts).max(axis=(1, 2, 3)) > 0]

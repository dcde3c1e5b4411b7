"""Times that are off at random, of each frame by another amount: they shift bodies by v dt.

Clocks of phones, times printed in milliseconds, pictures that were exposed for long.
"""

import numpy as np

from galileo_jax.statespace.kinematics import velocities
from galileo_jax.statespace.term import Patterns, Seen, Term, register


def _step_s(seen: Seen) -> float:
    times = seen.observation.times_s
    return float(np.median(np.diff(times))) if len(times) > 1 else 1.0


def _patterns(seen: Seen) -> Patterns:
    velocity = velocities(seen.observation)
    shifts = np.einsum("oat,tk->koat", velocity, np.eye(velocity.shape[-1]))
    return shifts[np.abs(shifts).max(axis=(1, 2, 3)) > 0]


register(
    Term(
        name="late_times",
        meaning="times are off by {size} at random",
        unit="s",
        median=lambda seen: 0.01 * _step_s(seen),
        factor=4.0,
        patterns=_patterns,
        is_of_marks=True,
    )
)

"""A hit that takes or gives momentum otherwise than between the two: friction, tipping."""

import numpy as np

from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import Patterns, Seen, Term, along_path, none, register


def _patterns(seen: Seen) -> Patterns:
    motion = seen.motion
    if motion is None or not motion.hits:
        return none(seen)
    jumps = np.zeros((len(motion.times_s) - 1, len(motion.moves)))
    for hit in motion.hits:
        jumps[hit.step, [hit.rear, hit.front]] += hit.lost_m_s, hit.gained_m_s
    return along_path(deviations(motion, jumps=jumps), motion, seen)


register(
    Term(
        name="hit_impulse",
        meaning="a share of {size} of a hit's impulse does not stay between the two bodies",
        unit="1",
        median=lambda _: 0.005,
        factor=3.0,
        patterns=_patterns,
    )
)

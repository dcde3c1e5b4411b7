"""A hit that takes or gives momentum otherwise than between the two: friction, tipping."""

import numpy as np

from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import Patterns, Seen, along_path, term

MEANING = "a share of {size} of a hit's impulse does not stay between the two bodies"


@term("hit_impulse", MEANING, "1", median=lambda _: 0.005, factor=3.0)
def hit_impulse(seen: Seen) -> Patterns | None:
    """Jumps of the speeds of both; none without a hit."""
    motion = seen.motion
    if motion is None or not motion.hits:
        return None
    jumps = np.zeros((len(motion.times_s) - 1, len(motion.moves)))
    for hit in motion.hits:
        jumps[hit.step, [hit.rear, hit.front]] += hit.lost_m_s, hit.gained_m_s
    return along_path(deviations(motion, jumps=jumps), motion)

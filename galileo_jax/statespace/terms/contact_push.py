"""What two bodies do to each other while they are near, after a hit: equal and opposite."""

import numpy as np

from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import Patterns, Seen, along_path, term

MEANING = "two bodies that are near each other change their relative speed by {size} in a second"


@term("contact_push", MEANING, "m/s", median=lambda _: 0.03, factor=3.0)
def contact_push(seen: Seen) -> Patterns | None:
    """White accelerations against each other; none without a hit."""
    motion = seen.motion
    if motion is None or not motion.hits:
        return None
    count = len(motion.moves)
    pushed = np.zeros((len(motion.times_s) - 1, count, count))
    for hit in motion.hits:
        total = hit.lost_m_s + hit.gained_m_s
        if total > 0:  # speeds change as the inverse of the masses
            way = np.zeros(count)
            way[[hit.rear, hit.front]] = -hit.lost_m_s / total, hit.gained_m_s / total
            pushed[hit.near] += np.outer(way, way)
    return along_path(deviations(motion, pushed=pushed), motion)

"""Friction that varies along the way, as on every board."""

from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import Patterns, Seen, along_path, term

NAME, LENGTH_M = "friction_roughness", 0.01
MEANING = "the friction coefficient varies by {size} along the way"


@term(NAME, MEANING, "1", median=lambda _: 0.005, factor=3.0)
def friction_roughness(seen: Seen) -> Patterns | None:
    """Of coefficients that are alike over a centimetre; none of what rests."""
    motion = seen.motion
    if motion is None or not motion.moves.any():
        return None
    return along_path(deviations(motion, LENGTH_M, 1.0), motion)

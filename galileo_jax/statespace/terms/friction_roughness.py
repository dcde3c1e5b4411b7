"""Friction that varies along the way, as on every board."""

from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import Patterns, Seen, Term, along_path, none, register

NAME, LENGTH_M = "friction_roughness", 0.01


def _patterns(seen: Seen) -> Patterns:
    motion = seen.motion
    if motion is None or not motion.moves.any():
        return none(seen)
    return along_path(deviations(motion, LENGTH_M, 1.0), motion, seen)


register(
    Term(
        name=NAME,
        meaning="the friction coefficient varies by {size} along the way",
        unit="1",
        median=lambda _: 0.005,
        factor=3.0,
        patterns=_patterns,
    )
)

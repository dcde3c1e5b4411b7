"""A stretch of one object's motion."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Phase:
    """A stretch of one object's motion.

    Attributes:
      name: "ramp", "foot", "table", "fall", "at rest", "after the hit", ...
      start_s, end_s: on the clip's clock.
    """

    name: str
    start_s: float
    end_s: float

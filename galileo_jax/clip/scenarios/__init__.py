"""The scenarios that a clip can show: one small file each in `library/`, in one registry."""

from dataclasses import dataclass
from typing import Literal

from galileo_jax.runtime.registry import Registry


@dataclass(frozen=True)
class Scenario:
    """What a scenario asks of its clip, and what its model begins with."""

    name: str  # as written in the clip yaml
    meaning: str  # one phrase for the user
    # its objects slide on a ramp or the table; it needs `ramp_angle_deg`, or has an `angle_deg`
    has_ramp: bool = False
    angle_deg: float | None = None  # of the surface, where that is no choice
    # (fewest, most) objects; None means no upper limit
    num_objects: tuple[int, int | None] = (1, 1)
    has_table: bool = False  # the ramp ends on a table
    is_level: bool = False  # objects slide on a level table that is seen from above
    # the path bends freely; False: it is straight, or a ramp and a table
    moves_in_plane: bool = False
    # the line that the motion is along, or is told by, where one coordinate is enough
    line: Literal["down", "slope", "level", "aside"] | None = None
    # what of a path tells which way is up: it falls, it hangs, it ends lower, it sinks (or rises)
    up_shows: Literal["bend", "sag", "drop", "sink"] | None = None
    # names of the laws of motion that are always there (`effects/laws/`)
    laws: tuple[str, ...] = ()
    # effects that have no place: the laws do the same, or the picture cannot tell them from these
    without: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()  # optional keys of the clip yaml that mean something here alone

    @property
    def has_surface(self) -> bool:
        """Whether something carries the objects: a ramp, a table."""
        return self.has_ramp or self.is_level

    @property
    def is_sloped(self) -> bool:
        """Whether they slide down a slope, whose angle may be another."""
        return self.has_ramp and self.angle_deg is None


SCENARIOS: Registry[Scenario] = Registry(
    "scenario", "scenarios", "galileo_jax.clip.scenarios.library"
)
register = SCENARIOS.register

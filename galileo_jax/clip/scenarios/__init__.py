"""The scenarios that a clip can show: one small file each in `library/`, in one registry."""

from dataclasses import dataclass
from typing import Literal

from galileo_jax.runtime.registry import Registry


@dataclass(frozen=True)
class Scenario:
    """What a scenario asks of its clip, and what its model begins with.

    Attributes:
      name: as written in the clip yaml.
      meaning: one phrase for the user.
      has_ramp: its objects slide on a ramp or the table; it needs `ramp_angle_deg`, unless there is
        an `angle_deg`.
      angle_deg: of the surface, where that is no choice.
      has_table: the ramp ends on a table.
      num_objects: (fewest, most) objects; None means no upper limit.
      is_level: objects slide on a level table that is seen from above.
      moves_in_plane: the path bends freely; False: it is straight, or a ramp and a table.
      line: the straight line that the motion is along, or is told by, for which one coordinate is
        enough: "down", "slope", "level" or "aside"; None: it needs two.
      up_shows: what of a path tells which way is up: "bend" (it falls), "sag" (it hangs) or
        "drop" (it ends lower); None: nothing.
      laws: names of the laws of motion that are always there (`effects/laws/`).
      without: effects that have no place, because the laws do the same or the picture cannot
        tell them from these.
      keys: optional keys of the clip yaml that mean something here alone.
    """

    name: str
    meaning: str
    has_ramp: bool
    angle_deg: float | None = None
    num_objects: tuple[int, int | None] = (1, 1)
    has_table: bool = False
    is_level: bool = False
    moves_in_plane: bool = False
    line: Literal["down", "slope", "level", "aside"] | None = None
    up_shows: Literal["bend", "sag", "drop"] | None = None
    laws: tuple[str, ...] = ()
    without: tuple[str, ...] = ()
    keys: tuple[str, ...] = ()

    @property
    def has_surface(self) -> bool:
        """Whether something carries the objects: a ramp, a table."""
        return self.has_ramp or self.is_level


SCENARIOS: Registry[Scenario] = Registry(
    "scenario", "scenarios", "galileo_jax.clip.scenarios.library"
)
register = SCENARIOS.register

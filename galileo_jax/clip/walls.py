"""Straight walls on a table that is seen from above, off which pucks bounce.

    walls:
      - {from_m: [x, y], to_m: [x, y]}       metres from the origin, along x and y of the track
      - {from_px: [x, y], to_px: [x, y]}     pixels of the video, x right, y down

The ends of the line that rims touch; on either side of it there may be pucks.
"""

import math
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, model_validator

from galileo_jax.clip.fields import Point, short, wrong

MOST_WALLS = 12
FARTHEST_M = 100.0
SHORTEST_M, SHORTEST_PX = 0.005, 4.0
PAIRS = (("from_m", "to_m"), ("from_px", "to_px"))


class Wall(BaseModel):
    """One straight wall."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # its ends from the origin, m
    from_m: Point | None = None
    to_m: Point | None = None
    # its ends in the picture, in place of these
    from_px: Point | None = None
    to_px: Point | None = None

    @model_validator(mode="after")
    def _is_line(self) -> "Wall":
        given = [pair for pair in PAIRS if any(getattr(self, key) is not None for key in pair)]
        if len(given) != 1:
            raise wrong("its ends either as from_m and to_m or as from_px and to_px expected")
        missing = [key for key in given[0] if getattr(self, key) is None]
        if missing:
            raise wrong(f"{missing[0]} is missing; both ends of the wall expected")
        one, other = (getattr(self, key) for key in given[0])
        in_metres = given[0] == PAIRS[0]
        if in_metres and max(map(abs, (*one, *other))) > FARTHEST_M:
            raise wrong(
                f"{list(one)} to {list(other)} is too far away; metres from the origin expected; "
                "are these millimetres or pixels?"
            )
        if math.dist(one, other) < (SHORTEST_M if in_metres else SHORTEST_PX):
            raise wrong(
                f"{list(one)} to {list(other)} is not a line; two ends that lie apart expected"
            )
        return self

    @property
    def is_in_pixels(self) -> bool:
        """Whether its ends were marked in the picture."""
        return self.from_px is not None

    @property
    def ends_m(self) -> tuple[Point, Point]:
        """Of a wall in metres."""
        assert self.from_m is not None and self.to_m is not None
        return self.from_m, self.to_m


def _walls(value: Any) -> Any:
    """A list of walls; pydantic sees to each."""
    if value is None:
        return ()
    if not isinstance(value, list | tuple):
        raise wrong(
            f"{short(value)} is not a list of walls, such as [{{from_m: [0, 0], to_m: [1, 0]}}]"
        )
    if len(value) > MOST_WALLS:
        raise wrong(f"{len(value)} walls; {MOST_WALLS} at most")
    return tuple(value)


Walls = Annotated[tuple[Wall, ...], BeforeValidator(_walls)]

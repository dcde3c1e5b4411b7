"""What a person draws into a clip."""

from dataclasses import dataclass, replace
from typing import Any

from galileo_jax.clip.scenarios import SCENARIOS

Point = tuple[float, float]
Correction = tuple[int, float, float]  # frame, x, y
Corners = tuple[Point, Point, Point, Point]

CORNERS = ("corner1", "corner2", "corner3", "corner4")  # from the bottom left, counter-clockwise
ENDS = {"rectangle": CORNERS, "stick": ("stick1", "stick2")}  # what of a mark can be grabbed


@dataclass(frozen=True)
class ObjectMark:
    """One object."""

    name: str
    point: Point | None = None  # its centre in the first frame, px
    shape: str = "box"  # as in the yaml
    size_m: tuple[float, ...] | None = None  # if it is known
    corrections: tuple[Correction, ...] = ()  # where it has been put right, by frame


@dataclass(frozen=True)
class Marks:
    """All marks of a clip; points in pixels of the video, x right, y down."""

    scenario: str = "ramp"  # what the clip shows
    fps: float = 30.0  # true frames per second
    objects: tuple[ObjectMark, ...] = ()  # in the order in which they set out
    upper: Point | None = None  # a point on the ramp's surface, high up
    # Where the ramp meets the table; without a table another point of its surface.
    foot: Point | None = None
    stick: tuple[Point, Point] | None = None  # the two ends of something whose length is known
    stick_m: float | None = None  # that length, m; None: nobody has said yet
    first_frame: int = 0  # the frame from which on the clip counts
    last_frame: int | None = None  # the last one that counts; None: that of the clip
    # The corners of a rectangle of known sides, in place of the stick, from the bottom left one
    # counter-clockwise.
    rectangle: Corners | None = None
    # Its width and height, m, as far as somebody has said; 0: not yet.
    rectangle_m: tuple[float, float] = (0.0, 0.0)

    @property
    def has_ramp(self) -> bool:
        """Whether the scenario has a slope."""
        scenario = SCENARIOS[self.scenario]
        return scenario.is_sloped

    @property
    def has_scale(self) -> bool:
        """Whether lengths are known."""
        if self.rectangle is not None:
            return min(self.rectangle_m) > 0
        return self.stick_m is not None

    @property
    def has_table(self) -> bool:
        """Whether the slope ends on a table."""
        return SCENARIOS[self.scenario].has_table


def handles(marks: Marks) -> dict[str, Point]:
    """Everything that can be grabbed, by name."""
    found = {one.name: one.point for one in marks.objects if one.point is not None}
    if marks.has_ramp:
        found |= {k: p for k in ("upper", "foot") if (p := getattr(marks, k)) is not None}
    scale = "stick" if marks.rectangle is None else "rectangle"
    return found | dict(zip(ENDS[scale], getattr(marks, scale) or (), strict=False))


def moved(marks: Marks, handle: str, to: Point) -> Marks:
    """The marks with one of them somewhere else.

    The foot takes the ramp's line with it, so that its angle stays; the upper end turns it.
    """
    to = (round(to[0], 2), round(to[1], 2))
    if handle == "foot" and marks.has_table and marks.foot and marks.upper:
        shift = (to[0] - marks.foot[0], to[1] - marks.foot[1])
        upper = (round(marks.upper[0] + shift[0], 2), round(marks.upper[1] + shift[1], 2))
        return replace(marks, foot=to, upper=upper)
    if handle in ("upper", "foot"):
        return replace(marks, **{handle: to})
    for mark, ends in ENDS.items():
        if handle in ends and (places := getattr(marks, mark)) is not None:
            at = ends.index(handle)
            return replace(marks, **{mark: (*places[:at], to, *places[at + 1 :])})
    return with_other(marks, handle, point=to)


def with_other(marks: Marks, name: str, **given: Any) -> Marks:
    """The marks with other values of one object."""
    objects = (replace(one, **given) if one.name == name else one for one in marks.objects)
    return replace(marks, objects=tuple(objects))


def with_rectangle(marks: Marks, size_px: tuple[int, int]) -> Marks:
    """A rectangle to be laid on one of known sides, in place of the stick."""
    (left, right), (top, bottom) = (
        (round(0.3 * side, 1), round(0.7 * side, 1)) for side in size_px
    )
    corners = ((left, bottom), (right, bottom), (right, top), (left, top))
    return replace(marks, rectangle=corners)


def corrected(marks: Marks, name: str, frame: int, to: Point | None) -> Marks:
    """The marks with an object put right in a frame; None: no more."""
    (was,) = (one.corrections for one in marks.objects if one.name == name)
    kept = [one for one in was if one[0] != frame]
    if to is not None:
        kept.append((frame, round(to[0], 2), round(to[1], 2)))
    return with_other(marks, name, corrections=tuple(sorted(kept)))


def with_object(marks: Marks, at: Point) -> Marks:
    """One more object."""
    taken = {one.name for one in marks.objects}
    name = next(n for i in range(1, 99) if (n := f"object{i}") not in taken)
    return replace(marks, objects=(*marks.objects, ObjectMark(name, at)))


def without_object(marks: Marks, name: str) -> Marks:
    """The marks without one of the objects."""
    return replace(marks, objects=tuple(one for one in marks.objects if one.name != name))

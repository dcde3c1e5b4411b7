"""Marks from what the program found and from a clip's yaml, and back into that."""

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from galileo_jax.studio.marks import Correction, Marks, ObjectMark, Point

STICKS_M = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
EDGE_PX = 10.0
STICK_SHARE = 0.3  # of the frame's width, that a stick is drawn over at first


def proposed(found: Mapping[str, Any], size_px: tuple[int, int]) -> Marks:
    """What the program found in a video, as marks; a stick to be laid on a known length.

    `found`: the fields of a `Proposal`.
    """
    ramp = found["ramp"]
    upper, foot = ((ramp[0], ramp[1]), (ramp[2], ramp[3])) if ramp is not None else (None, None)
    objects = tuple(
        ObjectMark(name, (round(x, 1), round(y, 1))) for name, (x, y) in found["objects"].items()
    )
    stick = _stick(size_px, None)[0]
    marks = Marks(found["scenario"], found["fps"], objects, upper, foot, stick)
    return replace(marks, first_frame=found["first_frames"].get(objects[0].name, 0))


def blank(fps: float, size_px: tuple[int, int]) -> Marks:
    """Marks of a video in which nothing was found: a line and a stick to be dragged."""
    width, height = size_px
    upper, foot = (0.2 * width, 0.4 * height), (0.5 * width, 0.7 * height)
    return Marks(fps=fps, upper=upper, foot=foot, stick=_stick(size_px, None)[0])


def declared(content: Mapping[str, Any], size_px: tuple[int, int], fps: float) -> Marks:
    """The marks that a clip's yaml stands for.

    `fps`: of the container, where the yaml says nothing.
    """
    listed = [one for one in content.get("objects") or () if isinstance(one, Mapping)]
    objects = tuple(
        ObjectMark(
            str(one["name"]),
            _pair(one.get("point_px")),
            str(one.get("shape", "box")),
            tuple(one["size_m"]) if one.get("size_m") else None,
            _corrections(one.get("corrections")),
        )
        for one in listed
    )
    stick, metres = _stick(size_px, content.get("pixels_per_metre"))
    first = listed[0] if listed else {}
    marks = Marks(
        str(content["scenario"]),
        float(content.get("fps", fps)),
        objects,
        stick=stick,
        stick_m=metres,
        first_frame=int(first.get("first_frame") or 0),
        last_frame=first.get("last_frame"),
    )
    if (found := content.get("rectangle")) is not None:
        corners = tuple(map(_point, found["corners_px"]))
        width, height = found["sides_m"]
        marks = replace(marks, rectangle=corners, rectangle_m=(float(width), float(height)))
    if not marks.has_ramp:
        return marks
    foot = _pair(content.get("origin_px"))
    start = objects[0].point if objects else None
    if foot is None or not marks.has_table:
        foot = start or (0.5 * size_px[0], 0.6 * size_px[1])
    angle = math.radians(float(content.get("ramp_angle_deg") or 20.0))
    along = -1.0 if content.get("direction") == "left" else 1.0
    # As high as object 1 stands, so that the line ends beside it.
    rise = max(foot[1] - start[1], 0.1 * size_px[1]) if start else 0.3 * size_px[1]
    room = (foot[0] if along > 0 else size_px[0] - foot[0]) - EDGE_PX
    rise = min(rise, max(room, EDGE_PX) * math.tan(angle))  # an end that can be grabbed
    upper = (round(foot[0] - along * rise / math.tan(angle), 3), round(foot[1] - rise, 3))
    return replace(marks, foot=foot, upper=upper)


def labels(before: Marks | None, after: Marks) -> dict[str, Any]:
    """What `label` is to write so that the yaml says what was drawn; empty if nothing changed.

    Only what was changed: a measured angle is not replaced because the foot was moved.
    """
    old = before or Marks(scenario="", fps=math.nan)
    found: dict[str, Any] = {}
    for key in ("scenario", "fps"):
        if (value := getattr(after, key)) != getattr(old, key):
            found[key] = value
    if after.has_ramp and after.upper and after.foot:
        if before is None or _line(before) != _line(after) or "scenario" in found:
            found["ramp"] = (*after.upper, *after.foot)
        if after.has_table and (before is None or before.foot != after.foot):
            found["origin"] = after.foot
    if after.has_scale and (before is None or _scale(before) != _scale(after)):
        if after.rectangle is not None:
            corners = (number for corner in after.rectangle for number in corner)
            found["rectangle"] = (*corners, *after.rectangle_m)
        elif after.stick is not None:
            found["scale"] = (*after.stick[0], *after.stick[1], after.stick_m)
    known = {one.name: one for one in old.objects}
    for one in after.objects:
        was = known.get(one.name, ObjectMark(one.name, shape=""))
        own = {
            "point": one.point if one.point != was.point else None,
            "shape": one.shape if one.shape != was.shape else None,
            "size": one.size_m if one.size_m != was.size_m else None,
        }
        own = {key: value for key, value in own.items() if value is not None}
        for key in ("first_frame", "last_frame"):
            if getattr(after, key) != getattr(old, key):
                own[key] = getattr(after, key)
        new = [c for c in one.corrections if c not in was.corrections]
        gone = {c[0] for c in was.corrections} - {c[0] for c in one.corrections}
        if new or gone:
            own["correct"] = [*new, *((frame,) for frame in sorted(gone))]
        for key, value in own.items():
            found.setdefault(key, {})[one.name] = value
    return found


def _line(marks: Marks) -> Point | None:
    """The direction of the ramp; moving it along with its foot changes nothing."""
    if marks.upper is None or marks.foot is None:
        return None
    return round(marks.foot[0] - marks.upper[0], 2), round(marks.foot[1] - marks.upper[1], 2)


def _scale(marks: Marks) -> tuple[Any, ...]:
    if marks.rectangle is not None:
        return marks.rectangle, marks.rectangle_m
    return marks.stick, marks.stick_m


def _corrections(found: Any) -> tuple[Correction, ...]:
    return tuple((int(frame), float(x), float(y)) for frame, x, y in found or ())


def _point(value: Any) -> Point:
    return float(value[0]), float(value[1])


def _pair(value: Any) -> Point | None:
    return None if value is None else _point(value)


def _stick(
    size_px: tuple[int, int], scale: float | None
) -> tuple[tuple[Point, Point], float | None]:
    """A stick near the lower edge; of a known scale as long as a round number of metres."""
    width, height = size_px
    length, metres = STICK_SHARE * width, None
    if scale:
        metres = min(STICKS_M, key=lambda one: abs(one * scale - length))
        length = metres * scale
    left, y = round(0.06 * width, 1), round(0.94 * height, 1)
    return ((left, y), (round(left + length, 3), y)), metres

"""`Check`: what is still missing in a clip's marks, or odd, in words."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.studio.marks import Corners, Marks

ODD_ANGLE_SD_DEG = 0.3  # worse, and the ramp's line decides how well k1 is known
USUAL_RATES = (24.0, 25.0, 29.97, 30.0)  # what containers of slow-motion clips say, too
SAME_RATE = 0.01


@dataclass(frozen=True)
class Remark:
    """One thing to know: `missing` holds tracking up, `odd` does not."""

    kind: Literal["missing", "odd"]
    sentence: str


def remarks_on(marks: Marks, container_fps: float, problem: str | None) -> tuple[Remark, ...]:
    """What to say of marks.

    `problem`: why the yaml could not be written, if it could not.
    """
    missing = [*_missing(marks), *([problem] if problem else [])]
    odd = _odd(marks, container_fps)
    return (*(Remark("missing", one) for one in missing), *(Remark("odd", one) for one in odd))


def _missing(marks: Marks) -> Iterator[str]:
    if not marks.objects:
        yield "No object is marked. Add one and drag it to its centre."
    if marks.has_ramp and not (marks.upper and marks.foot):
        yield "The ramp is not marked. Draw its line."
    if marks.rectangle is not None:
        if not marks.has_scale:
            yield "Type the rectangle's width and height, or switch back to the ruler."
        if _is_crossed(marks.rectangle):
            yield "The rectangle's corners are crossed: 1 is its bottom left, 2 its bottom right."
    elif marks.has_table and not marks.has_scale:
        yield "The scale is unknown. Drag the ruler onto a known length and type the length."


def _odd(marks: Marks, container_fps: float) -> Iterator[str]:
    if not marks.has_table and marks.rectangle is None and not marks.has_scale:
        yield "The scale is unknown: friction and scale show only in combination."
    is_from_file = abs(marks.fps - container_fps) < SAME_RATE
    if is_from_file and any(abs(marks.fps - rate) < SAME_RATE for rate in USUAL_RATES):
        yield (
            f"{marks.fps:.4g} frames per second is the rate in the file; slow-motion files "
            "often state a wrong one."
        )
    if marks.has_ramp and marks.upper and marks.foot:
        length = math.dist(marks.upper, marks.foot)
        sd = math.degrees(math.sqrt(2) * CLICK_SD_PX / max(length, 1e-6))
        if sd > ODD_ANGLE_SD_DEG:
            yield (
                f"The ramp's line is {length:.0f} px long: its angle is known to {sd:.1f} "
                "degrees. Draw a longer line."
            )


def _is_crossed(corners: Corners) -> bool:
    """Whether they do not go round counter-clockwise as seen, y down."""
    turns = []
    for i in range(4):
        (x1, y1), (x2, y2), (x3, y3) = (corners[(i + k) % 4] for k in range(3))
        turns.append((x2 - x1) * (y3 - y2) - (y2 - y1) * (x3 - x2))
    return max(turns) >= 0

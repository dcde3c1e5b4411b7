"""What a file says of a motion, before its units and axes are settled."""

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

METRES_PER_UNIT: dict[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "km": 1000.0,
    "in": 0.0254,
    "ft": 0.3048,
}
"""Units of length by the words with which files and `track_units` name them."""

MIN_LIKELIHOOD = 0.6  # DeepLabCut's own `pcutoff`: points less likely count as not seen


@dataclass(frozen=True)
class Calibration:
    """What a tool knows of its picture."""

    pixels_per_unit: tuple[float, float]  # along (x, y)
    unit: str | None  # of length; None where the file does not name it
    origin_px: tuple[float, float]  # x right, y down
    roll_rad: float = 0.0  # how its level x axis is turned against the picture's, counterclockwise


@dataclass(frozen=True)
class Column:
    """A column, as it was understood."""

    title: str  # as the file has it; "column 3" where it has none
    role: str  # "time", "frame", "x", ...; "" where it is not used
    name: str = ""  # of the object
    unit: str | None = None  # as the file has it; None where it has none
    # unit in the last place that is printed, in the column's unit; NaN where it is not used
    resolution: float = math.nan


@dataclass(frozen=True)
class TrackTable:
    """A motion in a table."""

    names: tuple[str, ...]  # of the objects, as the file calls them
    # `[object, axis, row]` in `unit`, x right; NaN where an object was not seen
    position: np.ndarray
    clock: np.ndarray  # `[row]`, s, or whole numbers of frames
    is_in_frames: bool = True  # the file gives frames, not times
    # what was measured, of "x", "y", "z", "line" (along the way) and "angle" (rad)
    axes: tuple[str, ...] = ("x", "y")
    is_counted: bool = False  # the file has neither: each row is a frame
    frame_s: float | None = None  # between two frames, s; None where the file does not tell
    # a key of `METRES_PER_UNIT`, or "px"; None where the file does not tell
    unit: str | None = None
    # `[axis]`, unit in the last place of positions as printed, in `unit`; empty where nothing was
    # rounded
    resolution: tuple[float, ...] = ()
    y_axis: Literal["up", "down"] | None = None  # None where the file does not tell
    calibration: Calibration | None = None  # of a file in pixels; None where it has none
    # rows at which a motion begins: the first, and those in which the clock begins anew
    starts: tuple[int, ...] = (0,)
    columns: tuple[Column, ...] = ()  # of a table, all that it has, in their order
    warnings: tuple[str, ...] = ()  # doubts, one line each

    def frame_s_by(self, fps: float | None) -> float:
        """Between two frames, s: as declared, or as the file tells; NaN where neither does."""
        return 1 / fps if fps else self.frame_s or math.nan

    def seconds(self, fps: float | None) -> np.ndarray:
        """`[row]`, s; NaN where nobody tells how long a frame is."""
        return self.clock * (self.frame_s_by(fps) if self.is_in_frames else 1.0)

    def motion(self, number: int) -> "TrackTable":
        """One of its motions, counted from 1."""
        ends = (*self.starts[1:], self.position.shape[-1])
        rows = slice(self.starts[number - 1], ends[number - 1])
        position, clock = self.position[..., rows], self.clock[rows]
        return replace(self, position=position, clock=clock, starts=(0,))

"""What a track file of another tool holds, before its units and axes are settled; the readers.

A file that adds a tool registers a reader and touches no other file:

    @register
    class MyTool(TrackReader):
        name = "my_tool"
        def claims(head): return head.startswith(b"my tool")
        def read(path): return TrackTable(...)
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from galileo_jax.runtime.registry import Registry

METRES_PER_UNIT: dict[str, float] = {
    "m": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "km": 1000.0,
    "in": 0.0254,
    "ft": 0.3048,
}
"""Units of length by the words with which files and `track_units` name them."""

UNIT_WORDS: dict[str, str] = {
    **{word: word for word in METRES_PER_UNIT},
    **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("px", "pix", "pixel", "pixels"), "px"),
}


@dataclass(frozen=True)
class Calibration:
    """What a tool knows of its picture.

    Attributes:
      pixels_per_unit: along (x, y).
      unit: of length; None where the file does not name it.
      origin_px: x right, y down.
      roll_rad: how its level x axis is turned against the picture's, counterclockwise.
    """

    pixels_per_unit: tuple[float, float]
    unit: str | None
    origin_px: tuple[float, float]
    roll_rad: float = 0.0


@dataclass(frozen=True)
class TrackTable:
    """The columns of a track file.

    Attributes:
      names: of the objects, as the tool calls them.
      position: `[object, 2, row]` in `unit`, x right; NaN where an object was not seen.
      times_s: `[row]`, s; None where the file counts `frames`.
      frames: `[row]`, whole numbers; None where it gives times.
      frame_s: between two frames, s; None where the file does not tell.
      unit: a key of `METRES_PER_UNIT`, or "px"; None where the file does not tell.
      y_axis: "up" or "down"; None where the file does not tell.
      calibration: of a file in pixels; None where it has none.
      warnings: doubts, one line each.
    """

    names: tuple[str, ...]
    position: np.ndarray
    times_s: np.ndarray | None = None
    frames: np.ndarray | None = None
    frame_s: float | None = None
    unit: str | None = None
    y_axis: Literal["up", "down"] | None = None
    calibration: Calibration | None = None
    warnings: tuple[str, ...] = ()


class TrackReader(ABC):
    """Reads the files of one tool.

    Attributes:
      name: in the registry.
      meaning: how messages to the user describe it.
    """

    name: ClassVar[str]
    meaning: ClassVar[str]

    @staticmethod
    @abstractmethod
    def claims(head: bytes) -> bool:
        """Whether a file that begins with `head` (64 kB) was written by this tool.

        By content alone: no two readers claim the same file.
        """

    @staticmethod
    @abstractmethod
    def read(path: Path) -> TrackTable:
        """The file's columns. Raises `InputError`, one line naming the file and the place."""


readers: Registry[type[TrackReader]] = Registry(
    "track reader", "track readers", "galileo_jax.clip.track_files"
)
register = readers.register

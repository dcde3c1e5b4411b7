"""What `simulate` was asked for: one field per option, with the option's default."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from galileo_jax.clip.fields import Shape
from galileo_jax.simulation.motion import Solver

SHAPES: dict[str, tuple[Shape, ...]] = {
    "ramp": ("box", "box"),
    "multi": ("box", "box", "box"),
    "incline": ("box",),
}
"""Scenarios on a ramp, and the shapes of their objects where none are given."""

FREE_SCENARIOS = ("fall", "flight", "spring", "liquid", "pendulum", "from_above")
SCENARIO_NAMES = (*SHAPES, *FREE_SCENARIOS)
CAMERA_FAULTS = ("keystone", "roll", "origin", "points")
DIRECTIONS = ("right", "left")
MOST_OBJECTS = 9  # of a multi
TRACK_SUFFIX, VIDEO_SUFFIX = ".csv", ".mp4"


@dataclass(frozen=True)
class Settings:
    """One call of `simulate`: its arguments of the same names, each with its default."""

    seed: int = 0
    scenario: str = "ramp"
    shapes: Sequence[str] | None = None
    angle: float = 20.0
    seconds: float | None = None
    fps: float = 30.0
    m1: float | None = None
    k1: float | None = None
    m2: float | None = None
    k2: float | None = None
    motion: str = "planar"
    z2: float | None = None
    solver: Solver = "rigid"
    values: Mapping[str, float] = field(default_factory=dict)
    floor: bool = False
    walls: bool = False
    release: float | None = None
    like: str | Path | None = None
    series: int | None = None
    track_only: bool = False
    track_noise: float = 0.0002
    effects: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    strength: float | None = None
    effects_from: Sequence[str | Path] = ()
    faults: bool = False
    size: tuple[int, int] = (640, 360)
    direction: Literal["right", "left"] = "right"
    no_points: bool = False
    hand: bool = False
    camera_fault: Sequence[str] = ()
    noise: float = 4.0
    exposure: float = 0.008
    defocus: float = 0.0
    missed_frames: int = 0

    @property
    def suffix(self) -> str:
        """Of the file that is the clip."""
        return TRACK_SUFFIX if self.track_only else VIDEO_SUFFIX

    @property
    def has_ramp(self) -> bool:
        """Whether objects slide on a ramp; otherwise one object falls, flies or hangs."""
        return self.scenario in SHAPES

"""What `simulate` was asked for: one field per option, with the option's default.

And the refusal of what it cannot do, or would ignore: the same sentences in Python and in a shell.
They name the command's options (`--track-noise`); the keyword of an option has its name.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from galileo_jax.clip.fields import MAX_ACROSS_M, Shape
from galileo_jax.rollout.engine_names import MOTIONS
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import check_known
from galileo_jax.simulation.motion import LONGEST_S, SOLVERS, Solver

SHAPES: dict[str, tuple[Shape, ...]] = {
    "ramp": ("box", "box"),
    "multi": ("box", "box", "box"),
    "incline": ("box",),
}
"""Scenarios on a ramp, and the shapes of their objects where none are given."""

FREE_SCENARIOS = ("fall", "flight", "spring", "liquid", "pendulum", "from_above")
SCENARIO_NAMES = (*SHAPES, *FREE_SCENARIOS)
CAMERA_FAULTS = ("keystone", "roll", "hand_held", "origin", "points")
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


DEFAULT = Settings()
RAMP_ONLY = (
    *("angle", "shapes", "m1", "k1", "m2", "k2", "series", "solver"),
    *("faults", "hand", "camera_fault", "no_points", "missed_frames", "release", "like"),
)
LIKE_HAS = ("shapes", "m1", "k1", "m2", "k2", "values", "series", "effects", "strength")

FILM_ONLY = (
    *("camera_fault", "size", "direction", "no_points", "hand"),
    *("noise", "exposure", "defocus", "missed_frames"),
)
OPTIONS = {"values": "--set", "effects": "--effect"}  # all others are named as their fields
SMALLEST_PX, LARGEST_PX = 64, 8192


class Limit(NamedTuple):
    """The numbers that an option takes."""

    low: float
    high: float = math.inf
    is_whole: bool = False


LIMITS = {
    "seed": Limit(0, is_whole=True),
    "angle": Limit(1, 60),
    "seconds": Limit(0.1, LONGEST_S),
    "fps": Limit(5, 1000),
    "m1": Limit(0.01, 100),
    "k1": Limit(0, 2),
    "m2": Limit(0.01, 100),
    "k2": Limit(0, 2),
    "z2": Limit(-MAX_ACROSS_M, MAX_ACROSS_M),
    "release": Limit(0.01, 10),
    "series": Limit(1, 99, is_whole=True),
    "track_noise": Limit(1e-6, 0.1),
    "strength": Limit(0, 1),
    "noise": Limit(0, 60),
    "exposure": Limit(0, 0.2),
    "defocus": Limit(0, 20),
    "missed_frames": Limit(0, 1000, is_whole=True),
}


def option(field: str) -> str:
    """The command's option for a field of `Settings`."""
    return OPTIONS.get(field, "--" + field.replace("_", "-"))


def options_without_part(settings: Settings) -> Iterator[tuple[tuple[str, ...], str]]:
    """Fields that the clip asked for would ignore, and why."""
    if settings.scenario in SCENARIO_NAMES and not settings.has_ramp:
        yield RAMP_ONLY, f"of a ramp only, not of scenario {settings.scenario}"
    if settings.has_ramp:
        yield ("floor",), "not of a ramp"
    if settings.scenario in SCENARIO_NAMES and settings.scenario != "from_above":
        yield ("walls",), f"of scenario from_above only, not of {settings.scenario}"
    if settings.scenario == "incline":
        yield ("m2", "k2"), "an incline has one object"
    if settings.track_only:
        yield FILM_ONLY, "a track (--track-only) has no camera"
    else:
        yield ("track_noise",), "of a track only (--track-only)"
    if settings.like is not None:
        yield LIKE_HAS, "is that of --like"
    if settings.series is not None:
        yield ("release",), "drawn for every trial of a --series"
    if not settings.effects:
        yield ("strength",), "of what? name an effect with --effect NAME"
    if not settings.effects and settings.like is None:  # what is hidden there may be of the file
        yield ("effects_from",), "nothing of it is used without --effect"
    if settings.motion != "free":
        yield ("z2",), "of --motion free only"


def checked(settings: Settings) -> Settings:
    """The settings with numbers as `float` and `int`, after all checks that need no effect.

    Raises:
      InputError: a name or number is none that the option takes, or an option has no part in
        the clip asked for.
    """
    numbers = {
        name: _number(option(name), value, limit)
        for name, limit in LIMITS.items()
        if (value := getattr(settings, name)) is not None
    }
    settings = replace(
        settings,
        **numbers,
        size=_size(settings.size),
        shapes=None if settings.shapes is None else tuple(settings.shapes),
        camera_fault=tuple(settings.camera_fault),
        effects={
            name: _values(f"--effect {name}", values, "PARAMETER=NUMBER")
            for name, values in settings.effects.items()
        },
        values=_values("--set", settings.values, "NAME=NUMBER"),
        effects_from=tuple(settings.effects_from),
    )
    _check_names(settings)
    for fields, why in options_without_part(settings):
        for name in fields:
            if getattr(settings, name) != getattr(DEFAULT, name):
                raise InputError(f"{option(name)}: {why}")
    if settings.motion == "free":
        _check_free_motion(settings)
    if settings.has_ramp:
        count = len(shapes_of(settings))
        _check_masses_and_frictions(settings.values, count)
    return settings


def shapes_of(settings: Settings) -> tuple[Shape, ...]:
    """The shapes of the objects on a ramp, as many as the scenario has.

    Raises:
      InputError: there is no such shape, or the scenario has fewer or more objects.
    """
    usual = SHAPES[settings.scenario]
    shapes = settings.shapes or usual
    for shape in shapes:
        check_known("--shapes", "shape", shape, get_args(Shape))
    is_multi = settings.scenario == "multi"
    most = MOST_OBJECTS if is_multi else len(usual)
    if not (2 if is_multi else most) <= len(shapes) <= most:
        raise InputError(
            f"--shapes: {len(shapes)} given; {settings.scenario} has {most} "
            f"(multi: 2 to {MOST_OBJECTS})"
        )
    return tuple(shapes)  # pyright: ignore[reportReturnType] - each is known


def _check_names(settings: Settings) -> None:
    check_known("--scenario", "scenario", settings.scenario, SCENARIO_NAMES)
    check_known("--motion", "kind of motion", settings.motion, MOTIONS)
    check_known("--solver", "solver", settings.solver, SOLVERS)
    check_known("--direction", "direction", settings.direction, DIRECTIONS)
    for fault in settings.camera_fault:
        check_known("--camera-fault", "fault", fault, CAMERA_FAULTS)


def _check_free_motion(settings: Settings) -> None:
    """What bodies that turn out of the plane cannot be."""
    if settings.scenario not in ("ramp", "multi"):
        raise InputError(f"--motion free: of ramp and multi, not of scenario {settings.scenario}")
    if not settings.track_only:
        raise InputError("--motion free: pictures show motion in a plane only; add --track-only")
    if settings.solver != "rigid":
        raise InputError(f"--solver {settings.solver}: of --motion planar only")


def _check_masses_and_frictions(values: Mapping[str, float], count: int) -> None:
    """`values` of a ramp: m1, k1 and so on."""
    names = [f"{key}{i + 1}" for i in range(count) for key in "mk"]
    for name, value in values.items():
        if name not in names:
            raise InputError(f"--set: no parameter {name!r}; known: {', '.join(names)}")
        _number(f"--set {name}", value, LIMITS[f"{name[0]}1"])


def _number(name: str, value: Any, limit: Limit) -> float | int:
    kind = Integral if limit.is_whole else Real
    number = float(value) if isinstance(value, kind) else math.nan
    if not limit.low <= number <= limit.high:
        high = limit.high
        within = f"at least {limit.low:g}" if high == math.inf else f"in [{limit.low:g}, {high:g}]"
        noun = "whole number" if limit.is_whole else "number"
        text = f"{value:g}" if isinstance(value, float) else str(value)
        raise InputError(f"{name}: {text!r} is not a {noun} {within}")
    return int(value) if isinstance(value, Integral) and limit.is_whole else number


def _values(name: str, values: Mapping[str, Any], form: str) -> dict[str, float]:
    """Values by parameter, finite."""
    numbers = {}
    for key, value in values.items():
        numbers[key] = float(value) if isinstance(value, Real) else math.nan
        if not math.isfinite(numbers[key]):
            raise InputError(f"{name}: '{key}={value}' is not {form}")
    return numbers


def _size(size: Any) -> tuple[int, int]:
    sides: list[Any] = [] if isinstance(size, str) or not isinstance(size, Sequence) else [*size]
    if len(sides) != 2 or not all(map(_is_side, sides)):
        text = "x".join(map(str, sides)) if sides else str(size)
        raise InputError(f"--size: {text!r} is not a size; even numbers such as 640x360 expected")
    return int(sides[0]), int(sides[1])


def _is_side(value: Any) -> bool:
    is_whole = isinstance(value, Integral)
    return is_whole and SMALLEST_PX <= int(value) <= LARGEST_PX and int(value) % 2 == 0

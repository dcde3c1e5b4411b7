"""What a user says about a clip, as values of its yaml."""

import math
from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from galileo_jax.runtime.errors import InputError

LEVELS = ("scenario", "setup", "object", "trial")
"""Folders of Physics 101 about which something can be declared."""

CLICK_SD_PX = 0.5
"""How well one reads off a pixel coordinate by eye: viewers show whole pixels, and lens and codec
blur an edge over one or two of them."""

END_TO_END_SD_PX = math.sqrt(2) * CLICK_SD_PX
"""How well the difference of two pixels is known, along their line or across it."""

NUMBERS = {
    "fps": "fps",
    "ramp_angle": "ramp_angle_deg",
    "ramp_angle_sd": "ramp_angle_sd_deg",
    "pixels_per_metre": "pixels_per_metre",
    "pixels_per_metre_sd": "pixels_per_metre_sd",
    "origin_sd": "origin_sd_px",
    "gravity": "gravity",
}
WORDS = ("scenario", "direction", "track_units", "track_y")
TWICE = (
    ("pixels_per_metre", "scale"),
    ("pixels_per_metre", "rectangle"),
    ("scale", "rectangle"),
    ("ramp_angle", "ramp"),
)
"""Options that say the same."""


@dataclass(frozen=True)
class Declaration:
    """One call of `label`: its arguments of the same names; None and empty mappings say nothing."""

    scenario: str | None = None
    fps: float | None = None
    point: Mapping[str, Sequence[float]] = field(default_factory=dict)
    size: Mapping[str, Sequence[float]] = field(default_factory=dict)
    shape: Mapping[str, str] = field(default_factory=dict)
    first_frame: Mapping[str, int | None] = field(default_factory=dict)
    last_frame: Mapping[str, int | None] = field(default_factory=dict)
    correct: Mapping[str, Sequence[Sequence[float]]] = field(default_factory=dict)
    pixels_per_metre: float | None = None
    pixels_per_metre_sd: float | None = None
    scale: Sequence[float] | None = None
    rectangle: Sequence[float] | None = None
    lens: Sequence[float] | None = None
    ramp_angle: float | None = None
    ramp_angle_sd: float | None = None
    ramp: Sequence[float] | None = None
    track_units: str | None = None
    track_y: str | None = None
    track_origin: Sequence[float] | None = None
    direction: str | None = None
    origin: Sequence[float] | None = None
    origin_sd: float | None = None
    gravity: float | None = None
    level: str = LEVELS[-1]

    def clip_values(self) -> dict[str, Any]:
        """The yaml's values that belong to no object, by key.

        Raises:
          InputError: a value is no number, two pixels are no line, or two options say the same.
        """
        for one, other in TWICE:
            if getattr(self, one) is not None and getattr(self, other) is not None:
                raise InputError(f"{_option(one)}: not allowed with {_option(other)}")
        values: dict[str, Any] = {}
        for name, (count, values_of) in READ_OFF.items():
            if (given := getattr(self, name)) is not None:
                values |= values_of(*_numbers(_option(name), given, count))
        values |= {key: word for key in WORDS if (word := getattr(self, key)) is not None}
        for name, key in NUMBERS.items():
            if (number := getattr(self, name)) is not None:
                (values[key],) = _numbers(_option(name), [number], 1)
        return values

    def object_values(self) -> defaultdict[str, dict[str, Any]]:
        """The values of each object that is named, by key.

        Raises:
          InputError: a value is no number, or no frame.
        """
        objects: defaultdict[str, dict[str, Any]] = defaultdict(dict)
        for name, shape in self.shape.items():
            objects[name]["shape"] = shape
        for option, key, count in (("size", "size_m", None), ("point", "point_px", 2)):
            for name, given in getattr(self, option).items():
                objects[name][key] = _numbers(f"--{option} {name}", given, count)
        for key in ("first_frame", "last_frame"):
            for name, frame in getattr(self, key).items():
                if not (frame is None or (isinstance(frame, int) and frame >= 0)):
                    raise InputError(
                        f"{_option(key)} {name}: {str(frame)!r} is not a frame number from 0, or "
                        "null"
                    )
                objects[name][key] = frame
        return objects

    def corrections(self, name: str, listed: Any) -> list[list[float]]:
        """An object's corrections, by frame, after this call.

        Raises:
          InputError: one is no frame with a place.
        """
        found = {one[0]: list(one) for one in listed or ()}
        for one in self.correct.get(name, ()):
            if len(one) not in (1, 3) or one[0] != int(one[0]):
                raise InputError(f"--correct {name}: {list(one)} is not a frame, x and y")
            found.pop(int(one[0]), None)
            if len(one) == 3:
                found[int(one[0])] = [int(one[0]), *_numbers(f"--correct {name}", one[1:], 2)]
        return [found[frame] for frame in sorted(found)]


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")


def _numbers(option: str, values: Sequence[Any], count: int | None = None) -> list[float]:
    if count is not None and len(values) != count:
        raise InputError(f"{option}: {len(values)} values given; {count} expected")
    numbers = []
    for value in values:
        try:
            numbers.append(float(value))
        except (TypeError, ValueError):
            raise InputError(f"{option}: {value!r} is not a number") from None
    return numbers


def _ramp(x1: float, y1: float, x2: float, y2: float) -> dict[str, Any]:
    """Angle and direction of a line that falls along the travel."""
    (high_x, high_y), (low_x, low_y) = sorted([(x1, y1), (x2, y2)], key=lambda point: point[1])
    dx, dy = low_x - high_x, low_y - high_y
    if not (math.isfinite(dx) and math.isfinite(dy)) or dx == 0 or dy == 0:
        raise InputError(
            f"--ramp: the two pixels differ by {dx:g} and {dy:g}; a sloping line expected"
        )
    angle = math.degrees(math.atan2(abs(dy), abs(dx)))
    sd = math.degrees(END_TO_END_SD_PX / math.hypot(dx, dy))
    return {
        "ramp_angle_deg": round(angle, 3),
        "ramp_angle_sd_deg": float(f"{sd:.3g}"),
        "direction": "right" if low_x > high_x else "left",
    }


def _scale(x1: float, y1: float, x2: float, y2: float, metres: float) -> dict[str, float]:
    """Pixels per metre, and how well the two pixels tell them."""
    distance = math.hypot(x2 - x1, y2 - y1)
    if not (math.isfinite(distance) and distance > 0):
        raise InputError("--scale: the two pixels are the same or not finite")
    if not (math.isfinite(metres) and metres > 0):
        raise InputError(f"--scale: {metres:g} is not a distance; metres above 0 expected")
    return {
        "pixels_per_metre": round(distance / metres, 3),
        "pixels_per_metre_sd": float(f"{END_TO_END_SD_PX / metres:.3g}"),
    }


def _rectangle(*numbers: float) -> dict[str, Any]:
    corners = [list(numbers[i : i + 2]) for i in range(0, 8, 2)]
    return {"rectangle": {"corners_px": corners, "sides_m": list(numbers[8:])}}


def _lens(*numbers: float) -> dict[str, Any]:
    if not 1 <= len(numbers) <= 2:
        raise InputError(f"--lens: {len(numbers)} values given; K1 or K1 SD expected")
    return {"lens": dict(zip(("k1", "k1_sd"), numbers, strict=False))}


READ_OFF: dict[str, tuple[int | None, Callable[..., dict[str, Any]]]] = {
    "ramp": (4, _ramp),
    "scale": (5, _scale),
    "rectangle": (10, _rectangle),
    "lens": (None, _lens),
    "origin": (2, lambda x, y: {"origin_px": [x, y], "origin_sd_px": CLICK_SD_PX}),
    "track_origin": (2, lambda x, y: {"track_origin": [x, y]}),
}
"""By option how many numbers it takes, and the yaml's values that they tell."""

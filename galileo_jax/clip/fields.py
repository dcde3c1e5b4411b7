"""The kinds of values in a clip's yaml: each checked for type, range and mistaken units."""

import math
import reprlib
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field
from pydantic_core import PydanticCustomError

LengthUnit = Literal["m", "cm", "mm", "km", "in", "ft", "px"]
YAxis = Literal["up", "down"]
UpAxis = Literal["y", "z", "x", "-x"]
Shape = Literal["box", "cylinder", "torus", "sphere"]
Direction = Literal["right", "left"]

SIZE_MEANING: dict[str, str] = {
    "box": "[length along travel, depth, height]",
    "cylinder": "[radius, length]",
    "torus": "[ring radius, tube radius]",
    "sphere": "[radius]",
}

MIN_SIZE_M, MAX_SIZE_M = 0.001, 2.0
MAX_ACROSS_M = 0.5
MIN_THREAD_M, MAX_THREAD_M = 0.01, 30.0
MIN_SCALE_PX_PER_M, MAX_SCALE_PX_PER_M = 5.0, 100_000.0
MIN_MASS_KG, MAX_MASS_KG = 1e-5, 100.0
MIN_GRAVITY, MAX_GRAVITY = 0.1, 30.0
MIN_DENSITY, MAX_DENSITY = 100.0, 20_000.0  # kg/m^3, of a liquid
MAX_SPIN_RAD_S = 5000.0  # of a table-tennis ball 1000
MIN_FPS, MAX_FPS = 1.0, 1_000_000.0
MAX_FLOOR_M = 1e6
MAX_ANGLE_SD_DEG = 10.0
MAX_SCALE_SD_SHARE = 0.2  # a scale known worse than this is a guess: leave it null
MAX_ORIGIN_SD_PX = 50.0  # a foot known worse than this is null: found from the path
MIN_RAMP_ANGLE_DEG = 1.0  # below it nothing slides; it is an angle in radians


def wrong(message: str) -> PydanticCustomError:
    """A validation error whose text reaches the user as it stands."""
    return PydanticCustomError("clip", "{text}", {"text": message})


def _suggestion(value: float, *factors_and_units: tuple[float, str]) -> str:
    """' did you mean 0.06 (60 mm)?' for the first (factor, unit) that is given."""
    factor, unit = factors_and_units[0]
    return f"did you mean {value * factor:g} ({value:g} {unit})?"


def _metres(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a length; metres above 0 expected")
    if value > MAX_SIZE_M:
        hint = _suggestion(value, (0.01, "cm") if value < 20 else (0.001, "mm"))
        raise wrong(f"{value:g} m is too large for an object; metres expected; {hint}")
    if value < MIN_SIZE_M:
        raise wrong(f"{value:g} m is smaller than a millimetre; metres expected")
    return value


def _across(value: float) -> float:
    if abs(value) > MAX_ACROSS_M:
        hint = _suggestion(value, (0.01, "cm") if abs(value) < 20 else (0.001, "mm"))
        raise wrong(f"{value:g} m is too far from the plane of the motion; metres expected; {hint}")
    return value


def _thread(value: float) -> float:
    if not MIN_THREAD_M <= value <= MAX_THREAD_M:
        hint = "; " + _suggestion(value, (0.01, "cm")) if value > MAX_THREAD_M else ""
        raise wrong(
            f"{value:g} m is not a length of a thread; {MIN_THREAD_M:g} to {MAX_THREAD_M:g} m "
            f"expected{hint}"
        )
    return value


def _kilograms(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a mass; kilograms above 0 expected")
    if value > MAX_MASS_KG:
        hint = _suggestion(value, (0.001, "g"))
        raise wrong(f"{value:g} kg is too heavy for an object; kilograms expected; {hint}")
    if value < MIN_MASS_KG:
        raise wrong(f"{value:g} kg is less than ten milligrams; kilograms expected")
    return value


def _pixels_per_metre(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a scale; pixels per metre above 0, or null, expected")
    if value < MIN_SCALE_PX_PER_M:
        hint = (
            f"did you mean {1 / value:.4g} ({value:g} metres per pixel)?"
            if value < 0.05
            else _suggestion(value, (1000, "pixels per millimetre"))
        )
        raise wrong(f"{value:g} is too small; pixels per metre expected; {hint}")
    if value > MAX_SCALE_PX_PER_M:
        raise wrong(
            f"{value:g} is too large; pixels per metre expected; did you mean {value / 1000:g}?"
        )
    return value


def _gravity(value: float) -> float:
    if value <= 0:
        hint = f"; did you mean {-value:g}?" if MIN_GRAVITY <= -value <= MAX_GRAVITY else ""
        raise wrong(f"{value:g} is not above 0; the size of gravity in m/s^2 expected{hint}")
    if value > MAX_GRAVITY:
        raise wrong(
            f"{value:g} is too large; m/s^2 expected; " + _suggestion(value, (0.01, "cm/s^2"))
        )
    if value < MIN_GRAVITY:
        raise wrong(f"{value:g} is too small; m/s^2 expected (9.81 on earth)")
    return value


def _fps(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not above 0; frames per second expected")
    if value < MIN_FPS:
        hint = f"did you mean {1 / value:.4g} ({value:g} seconds per frame)?"
        raise wrong(f"{value:g} is too small; frames per second expected; {hint}")
    if value > MAX_FPS:
        raise wrong(f"{value:g} is too large; frames per second expected")
    return value


def _ramp_angle_deg(value: float) -> float:
    if not 0 < value < 90:
        raise wrong(f"{value:g} is outside (0, 90) degrees")
    if value < MIN_RAMP_ANGLE_DEG:
        degrees = math.degrees(value)
        raise wrong(
            f"{value:g} is too flat to slide; degrees expected; "
            f"did you mean {degrees:.4g} ({value:g} radians)?"
        )
    return value


def _up_to(most: float, unit: str) -> AfterValidator:
    """Refuses what is negative, or more than `most`."""

    def check(value: float) -> float:
        if not 0 <= value <= most:
            raise wrong(f"{value:g} is outside [0, {most:g}] {unit}")
        return value

    return AfterValidator(check)


def _scale_sd(value: float) -> float:
    if value < 0:
        raise wrong(f"{value:g} is negative; pixels per metre, 0 or more, expected")
    return value


def _floor(value: Any) -> Any:
    if isinstance(value, bool) or value is None:
        return value
    # Integers of YAML may be larger than any float.
    if isinstance(value, int | float) and abs(value) < MAX_FLOOR_M:
        return float(value)
    raise wrong(f"{short(value)} is not a height; metres above the origin, or true, expected")


def _rolls(value: Any) -> Any:
    if isinstance(value, bool) or value is None:
        return value
    if isinstance(value, int | float) and 0 < value <= 1:
        return float(value)
    raise wrong(
        f"{short(value)} is not a share J / (m r^2) in (0, 1]; a share such as 0.667 (hollow "
        "ball), "
        "or true (solid), expected"
    )


def _liquid_density(value: float) -> float:
    if value <= 0:
        raise wrong(f"{value:g} is not a density; kg/m^3 above 0 expected")
    if value < MIN_DENSITY:
        raise wrong(
            f"{value:g} is too small for a liquid; kg/m^3 expected; "
            + _suggestion(value, (1000, "g/cm^3"))
        )
    if value > MAX_DENSITY:
        raise wrong(f"{value:g} is too large; kg/m^3 expected (water: 998)")
    return value


def _point_px(value: tuple[float, float]) -> tuple[float, float]:
    if all(0 < coordinate < 1 for coordinate in value):
        raise wrong(f"{list(value)} are fractions of the frame; pixels expected")
    return value


def _spin(value: Any) -> Any:
    """Three numbers, rad/s."""
    if value is None:
        return None
    is_list = isinstance(value, list | tuple)
    if not is_list or len(value) != 3 or not all(map(_is_real, value)):
        has = (
            f"has {len(value)} values"
            if is_list and len(value) != 3
            else "is not a list of numbers"
        )
        raise wrong(f"{short(value)} {has}; [x, y, z] in rad/s expected")
    if max(map(abs, value)) > MAX_SPIN_RAD_S:
        raise wrong(
            f"{short(list(value))} is faster than anything thrown; rad/s expected; are these "
            "turns per minute or degrees per second?"
        )
    return tuple(map(float, value))


def _is_real(value: Any) -> bool:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return is_number and math.isfinite(value)


def _name(value: str) -> str:
    if not value.isidentifier():
        raise wrong(
            f"{short(value)} is not a name; letters, digits and _ expected, such as object1"
        )
    return value


def _corrections(value: Any) -> Any:
    """A list of [frame, x, y]; pydantic sees to the numbers."""
    is_list = isinstance(value, list | tuple)
    if not is_list or not all(isinstance(one, list | tuple) and len(one) == 3 for one in value):
        raise wrong(f"{short(value)} is not a list of [frame, x, y], such as [[24, 312.0, 221.5]]")
    frames = [one[0] for one in value]
    if len({*map(str, frames)}) < len(frames):
        raise wrong(f"{short(value)} has a frame twice; one place for each frame expected")
    return tuple(map(tuple, value))


def _path(value: Any) -> Any:
    if isinstance(value, str) and 0 < len(value) < 256 and value.isprintable():
        return Path(value)
    if isinstance(value, Path) or value is None:
        return value
    raise wrong(f"{short(value)} is not a file name")


def one_of(known: tuple[str, ...]) -> BeforeValidator:
    """Refuses anything but the `known` words and lists them."""

    def check(value: Any) -> Any:
        if not isinstance(value, str) or value not in known:
            raise wrong(f"unknown value {short(value)}; known: {', '.join(known)}")
        return value

    return BeforeValidator(check)


_REPR = reprlib.Repr()  # aliases in a yaml can make a value that is endless when written out
_REPR.maxlevel, _REPR.maxstring, _REPR.maxother = 3, 60, 60


def short(value: Any) -> str:
    """A value as it looks in yaml, cut to 60 characters, on one line."""
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    try:
        text = " ".join(_REPR.repr(value).split())
    except ValueError:  # an integer with more digits than Python prints
        text = "a number of thousands of digits"
    return text if len(text) <= 60 else text[:57] + "..."


Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Frame = Annotated[int, Field(strict=True, ge=0)]
Trial = Annotated[int, Field(strict=True, ge=1)] | None
Point = tuple[Number, Number]
Correction = tuple[Frame, Number, Number]
Metres = Annotated[Number, AfterValidator(_metres)]
Kilograms = Annotated[Number, AfterValidator(_kilograms)]
File = Annotated[Path | None, BeforeValidator(_path)]
OneLine = Annotated[str, Field(strict=True, min_length=1, max_length=80)]
Across = Annotated[Number, AfterValidator(_across)]
Thread = Annotated[Number, AfterValidator(_thread)]
Scale = Annotated[Number, AfterValidator(_pixels_per_metre)]
ScaleSd = Annotated[Number, AfterValidator(_scale_sd)]
Gravity = Annotated[Number, AfterValidator(_gravity)]
FrameRate = Annotated[Number, AfterValidator(_fps)]
RampAngle = Annotated[Number, AfterValidator(_ramp_angle_deg)]
AngleSd = Annotated[Number, _up_to(MAX_ANGLE_SD_DEG, "degrees")]
OriginSd = Annotated[Number, _up_to(MAX_ORIGIN_SD_PX, "pixels")]
LiquidDensity = Annotated[Number, AfterValidator(_liquid_density)]
MarkedPoint = Annotated[Point, AfterValidator(_point_px)]
Corrections = Annotated[tuple[Correction, ...], BeforeValidator(_corrections)]
Spin = Annotated[tuple[float, float, float] | None, BeforeValidator(_spin)]
Rolls = Annotated[bool | float | None, BeforeValidator(_rolls)]
Floor = Annotated[bool | float | None, BeforeValidator(_floor)]
ObjectName = Annotated[str, Field(strict=True), AfterValidator(_name)]

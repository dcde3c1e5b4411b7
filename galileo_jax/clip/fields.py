"""The kinds of values in a clip's yaml: each checked for type, range and mistaken units."""

import math
import operator
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
MIN_SCALE_PX_PER_M, MAX_SCALE_PX_PER_M = 5.0, 100_000.0
MAX_SPIN_RAD_S = 5000.0  # of a table-tennis ball 1000
MAX_FLOOR_M = 1e6
MAX_ANGLE_SD_DEG = 10.0
MAX_SCALE_SD_SHARE = 0.2  # a scale known worse than this is a guess: leave it null
MAX_ORIGIN_SD_PX = 50.0  # a foot known worse than this is null: found from the path
MIN_RAMP_ANGLE_DEG = 1.0  # below it nothing slides; it is an angle in radians

COMPARED = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}


def wrong(message: str) -> PydanticCustomError:
    """A validation error whose text reaches the user as it stands."""
    return PydanticCustomError("clip", "{text}", {"text": message})


def refused(problems: dict[str, str]) -> AfterValidator:
    """Refuses numbers: by comparison (`"> 2.0"`), the first that holds, what is wrong with one.

    In the text `{v}` is the number, `{centi}` a hundredth of it, and so on.
    """
    rules = [(*rule.split(), text) for rule, text in problems.items()]

    def check(value: float) -> float:
        for sign, limit, text in rules:
            if COMPARED[sign](value, float(limit)):
                parts = {"centi": 0.01 * value, "milli": 0.001 * value, "kilo": 1000 * value}
                parts |= {"inverse": 1 / (value or math.nan), "degrees": math.degrees(value)}
                raise wrong(text.format(v=value, minus=-value, **parts))
        return value

    return AfterValidator(check)


def _within(low: float, high: float, unit: str) -> AfterValidator:
    problem = f"{{v:g}} is outside [{low:g}, {high:g}] {unit}"
    return refused({f"< {low}": problem, f"> {high}": problem})


def is_number(value: Any, below: float = math.inf) -> bool:
    """Whether a value of a yaml is a number, which `true` is not, and no larger; also no NaN."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < below


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
        "ball), or true (solid), expected"
    )


def _point_px(value: tuple[float, float]) -> tuple[float, float]:
    if all(0 < coordinate < 1 for coordinate in value):
        raise wrong(f"{list(value)} are fractions of the frame; pixels expected")
    return value


def _spin(value: Any) -> Any:
    """Three numbers, rad/s."""
    if value is None:
        return None
    is_list = isinstance(value, list | tuple)
    if not is_list or len(value) != 3 or not all(map(is_number, value)):
        is_short = is_list and len(value) != 3
        has = f"has {len(value)} values" if is_short else "is not a list of numbers"
        raise wrong(f"{short(value)} {has}; [x, y, z] in rad/s expected")
    if max(map(abs, value)) > MAX_SPIN_RAD_S:
        raise wrong(
            f"{short(list(value))} is faster than anything thrown; rad/s expected; are these "
            "turns per minute or degrees per second?"
        )
    return tuple(map(float, value))


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
    if len({str(one[0]) for one in value}) < len(value):
        raise wrong(f"{short(value)} has a frame twice; one place for each frame expected")
    return tuple(map(tuple, value))


def _path(value: Any) -> Any:
    if isinstance(value, str) and 0 < len(value) < 256 and value.isprintable():
        return Path(value)
    if isinstance(value, Path) or value is None:
        return value
    raise wrong(f"{short(value)} is not a file name")


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


_TOO_LARGE = "{v:g} m is too large for an object; metres expected; did you mean "
_TOO_FAR = "{v:g} m is too far from the plane of the motion; metres expected; did you mean "
_NO_THREAD = "{v:g} m is not a length of a thread; 0.01 to 30 m expected"
_SMALL_SCALE = "{v:g} is too small; pixels per metre expected; did you mean "
_NO_GRAVITY = "{v:g} is not above 0; the size of gravity in m/s^2 expected"
_IN_CM, _IN_MM = "{centi:g} ({v:g} cm)?", "{milli:g} ({v:g} mm)?"

Yes = Annotated[bool, Field(strict=True)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Frame = Annotated[int, Field(strict=True, ge=0)]
Trial = Annotated[int, Field(strict=True, ge=1)] | None
Point = tuple[Number, Number]
Metres = Annotated[Number, refused({
    "<= 0": "{v:g} is not a length; metres above 0 expected",
    ">= 20": _TOO_LARGE + _IN_MM,
    f"> {MAX_SIZE_M}": _TOO_LARGE + _IN_CM,
    f"< {MIN_SIZE_M}": "{v:g} m is smaller than a millimetre; metres expected",
})]  # fmt: skip
Kilograms = Annotated[Number, refused({
    "<= 0": "{v:g} is not a mass; kilograms above 0 expected",
    "> 100": "{v:g} kg is too heavy for an object; kilograms expected; did you mean "
             "{milli:g} ({v:g} g)?",
    "< 1e-5": "{v:g} kg is less than ten milligrams; kilograms expected",
})]  # fmt: skip
Across = Annotated[Number, refused({
    ">= 20": _TOO_FAR + _IN_MM,
    "<= -20": _TOO_FAR + _IN_MM,
    f"> {MAX_ACROSS_M}": _TOO_FAR + _IN_CM,
    f"< -{MAX_ACROSS_M}": _TOO_FAR + _IN_CM,
})]  # fmt: skip
Thread = Annotated[Number, refused({
    "> 30": f"{_NO_THREAD}; did you mean {_IN_CM}",
    "< 0.01": _NO_THREAD,
})]  # fmt: skip
Scale = Annotated[Number, refused({
    "<= 0": "{v:g} is not a scale; pixels per metre above 0, or null, expected",
    "< 0.05": _SMALL_SCALE + "{inverse:.4g} ({v:g} metres per pixel)?",
    f"< {MIN_SCALE_PX_PER_M}": _SMALL_SCALE + "{kilo:g} ({v:g} pixels per millimetre)?",
    f"> {MAX_SCALE_PX_PER_M}": "{v:g} is too large; pixels per metre expected; did you mean "
                               "{milli:g}?",
})]  # fmt: skip
ScaleSd = Annotated[Number, refused({
    "< 0": "{v:g} is negative; pixels per metre, 0 or more, expected",
})]  # fmt: skip
Gravity = Annotated[Number, refused({
    "< -30": _NO_GRAVITY,
    "<= -0.1": _NO_GRAVITY + "; did you mean {minus:g}?",
    "<= 0": _NO_GRAVITY,
    "> 30": "{v:g} is too large; m/s^2 expected; did you mean {centi:g} ({v:g} cm/s^2)?",
    "< 0.1": "{v:g} is too small; m/s^2 expected (9.81 on earth)",
})]  # fmt: skip
FrameRate = Annotated[Number, refused({
    "<= 0": "{v:g} is not above 0; frames per second expected",
    "< 1": "{v:g} is too small; frames per second expected; did you mean {inverse:.4g} "
           "({v:g} seconds per frame)?",
    "> 1e6": "{v:g} is too large; frames per second expected",
})]  # fmt: skip
RampAngle = Annotated[Number, refused({
    "< 0": "{v:g} is outside (0, 90) degrees; which way a ramp falls is direction: left or right",
    "<= 0": "{v:g} is outside (0, 90) degrees; what slides on a level table: scenario: level",
    ">= 90": "{v:g} is outside (0, 90) degrees; what goes straight down: scenario: fall",
    f"< {MIN_RAMP_ANGLE_DEG}": "{v:g} is too flat to slide; degrees expected; did you mean "
                               "{degrees:.4g} ({v:g} radians)?",
})]  # fmt: skip
LiquidDensity = Annotated[Number, refused({
    "<= 0": "{v:g} is not a density; kg/m^3 above 0 expected",
    "< 100": "{v:g} is too small for a liquid; kg/m^3 expected; did you mean {kilo:g} "
             "({v:g} g/cm^3)?",
    "> 20000": "{v:g} is too large; kg/m^3 expected (water: 998)",
})]  # fmt: skip
AngleSd = Annotated[Number, _within(0, MAX_ANGLE_SD_DEG, "degrees")]
OriginSd = Annotated[Number, _within(0, MAX_ORIGIN_SD_PX, "pixels")]
File = Annotated[Path | None, BeforeValidator(_path)]
OneLine = Annotated[str, Field(strict=True, min_length=1, max_length=80)]
MarkedPoint = Annotated[Point, AfterValidator(_point_px)]
Corrections = Annotated[tuple[tuple[Frame, Number, Number], ...], BeforeValidator(_corrections)]
Spin = Annotated[tuple[float, float, float] | None, BeforeValidator(_spin)]
Rolls = Annotated[bool | float | None, BeforeValidator(_rolls)]
Floor = Annotated[bool | float | None, BeforeValidator(_floor)]
ObjectName = Annotated[str, Field(strict=True), AfterValidator(_name)]

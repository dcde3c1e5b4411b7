"""What is declared about a camera that is not square to the plane of the motion, or not straight.

    rectangle: {corners_px: [[x, y], [x, y], [x, y], [x, y]], sides_m: [width, height]}
    lens: {k1: number, k1_sd: number}

The rectangle lies in the plane of the motion, its bottom side level; it tells the scale as well.
The lens draws a point that is r from the picture's middle at r (1 + k1 r^2), with r in half
diagonals of the picture: k1 < 0 is a barrel, as wide lenses have it.

Source: Hartley and Zisserman, Multiple View Geometry (2004), sections 2.3 and 7.4.
"""

import math
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field
from pydantic_core import PydanticCustomError

CORNERS = 4
LONGEST_M = 100.0
FLATTEST = 1e-3  # sine of a corner's angle below which its sides lie on one line
MIN_K1, MAX_K1 = -0.3, 0.5  # below -1/3 the picture would fold within its own corners
MAX_K1_SD = 0.2

Pixel = tuple[float, float]


def _wrong(message: str) -> PydanticCustomError:
    return PydanticCustomError("clip", "{text}", {"text": message})


def _is_number(value: Any) -> bool:
    is_real = isinstance(value, int | float) and not isinstance(value, bool)
    return is_real and abs(value) < 1e9  # also no NaN


def _corners(value: Any) -> tuple[Pixel, ...]:
    if not isinstance(value, list | tuple):
        raise _wrong("no list; four corners [x, y] in pixels expected")
    if len(value) != CORNERS:
        raise _wrong(f"{len(value)} corners; four expected, from the bottom left one on")
    for corner in value:
        is_pair = isinstance(corner, list | tuple) and len(corner) == 2
        if not (is_pair and all(map(_is_number, corner))):
            raise _wrong("a corner is not [x, y] in pixels")
    corners = np.array(value, float)
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*before.T) * np.hypot(*after.T)
    # Of y that points down: counter-clockwise as seen is negative.
    sines = -(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / np.maximum(lengths, 1e-9)
    if (sines < -FLATTEST).all():
        raise _wrong("corners go round clockwise; bottom left, bottom right, top right, top left")
    if not (sines > FLATTEST).all():
        raise _wrong(
            "sides cross, or three corners lie on a line; bottom left, bottom right, top right, "
            "top left expected"
        )
    return tuple((float(x), float(y)) for x, y in corners)


def _sides(value: Any) -> tuple[float, float]:
    is_pair = isinstance(value, list | tuple) and len(value) == 2
    if not (is_pair and all(map(_is_number, value))):
        raise _wrong("[width, height] in metres expected")
    for side in value:
        if not 0 < side <= LONGEST_M:
            raise _wrong(f"{side:g} is not the length of a side; metres above 0 expected")
    return float(value[0]), float(value[1])


def _k1(value: float) -> float:
    if not MIN_K1 <= value <= MAX_K1:
        raise _wrong(
            f"{value:g} is outside [{MIN_K1:g}, {MAX_K1:g}]; how much longer the lens makes half a "
            "diagonal of the picture, as a share of it"
        )
    return value


class Rectangle(BaseModel):
    """A rectangle in the plane of the motion.

    Attributes:
      corners_px: bottom left, bottom right, top right and top left as seen upright, x right, y
        down; each known within half a pixel.
      sides_m: width and height.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    corners_px: Annotated[tuple[Pixel, ...], BeforeValidator(_corners)]
    sides_m: Annotated[tuple[float, float], BeforeValidator(_sides)]


class Lens(BaseModel):
    """How a lens bends straight lines.

    Attributes:
      k1: radial distortion, see the module.
      k1_sd: how well it is known (one standard deviation); 0 = taken at its word.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    k1: Annotated[float, Field(strict=True, allow_inf_nan=False), AfterValidator(_k1)]
    k1_sd: Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0, le=MAX_K1_SD)] = 0.0


def half_diagonal_px(size_px: tuple[int, int]) -> float:
    """The unit of a lens's r, px."""
    return math.hypot(*size_px) / 2

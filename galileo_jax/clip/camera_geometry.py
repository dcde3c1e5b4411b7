"""What is declared about a camera that is not square to the plane of the motion, or not straight.

    rectangle: {corners_px: [[x, y], [x, y], [x, y], [x, y]], sides_m: [width, height]}
    lens: {k1: number, k1_sd: number}

The rectangle lies in the plane of the motion, its bottom side level; it tells the scale as well.
The lens draws a point that is r from the picture's middle at r (1 + k1 r^2), with r in half
diagonals of the picture: k1 < 0 is a barrel, as wide lenses have it.

Source: Hartley and Zisserman, Multiple View Geometry (2004), sections 2.3 and 7.4.
"""

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

from galileo_jax.clip.fields import Number, is_number, refused, wrong

CORNERS = 4
LONGEST_M = 100.0
FLATTEST = 1e-3  # sine of a corner's angle below which its sides lie on one line
MIN_K1, MAX_K1 = -0.3, 0.5  # below -1/3 the picture would fold within its own corners
NO_K1 = (
    f"{{v:g}} is outside [{MIN_K1:g}, {MAX_K1:g}]; how much longer the lens makes half a "
    "diagonal of the picture, as a share of it"
)
MOST_PX = 1e9

Pixel = tuple[float, float]


def _is_pair(value: Any) -> bool:
    is_list = isinstance(value, list | tuple) and len(value) == 2
    return is_list and all(is_number(one, MOST_PX) for one in value)


def _corners(value: Any) -> tuple[Pixel, ...]:
    if not isinstance(value, list | tuple):
        raise wrong("no list; four corners [x, y] in pixels expected")
    if len(value) != CORNERS:
        raise wrong(f"{len(value)} corners; four expected, from the bottom left one on")
    if not all(map(_is_pair, value)):
        raise wrong("a corner is not [x, y] in pixels")
    corners = np.array(value, float)
    before, after = corners - np.roll(corners, 1, axis=0), np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(*before.T) * np.hypot(*after.T)
    # Of y that points down: counter-clockwise as seen is negative.
    sines = -(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]) / np.maximum(lengths, 1e-9)
    if (sines < -FLATTEST).all():
        raise wrong("corners go round clockwise; bottom left, bottom right, top right, top left")
    if not (sines > FLATTEST).all():
        raise wrong(
            "sides cross, or three corners lie on a line; bottom left, bottom right, top right, "
            "top left expected"
        )
    return tuple((float(x), float(y)) for x, y in corners)


def _sides(value: Any) -> tuple[float, float]:
    if not _is_pair(value):
        raise wrong("[width, height] in metres expected")
    for side in value:
        if not 0 < side <= LONGEST_M:
            raise wrong(f"{side:g} is not the length of a side; metres above 0 expected")
    return float(value[0]), float(value[1])


class Rectangle(BaseModel):
    """A rectangle in the plane of the motion."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # bottom left, bottom right, top right and top left as seen upright, x right, y down; each known
    # within half a pixel
    corners_px: Annotated[tuple[Pixel, ...], BeforeValidator(_corners)]
    sides_m: Annotated[tuple[float, float], BeforeValidator(_sides)]  # width and height


class Lens(BaseModel):
    """How a lens bends straight lines."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    # radial distortion, see the module
    k1: Annotated[Number, refused(dict.fromkeys((f"< {MIN_K1}", f"> {MAX_K1}"), NO_K1))]
    # how well it is known (one standard deviation); 0 = taken at its word
    k1_sd: Annotated[Number, Field(ge=0, le=0.2)] = 0.0

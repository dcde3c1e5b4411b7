"""Pictures that are woven from two fields, taken at two times: found by what moves in them.

    R = sum |I(y) - I(y + 2)| / sum |I(y) - I(y + 1)|,    over pixels that changed

In a whole picture rows two apart differ more than neighbours (R 1.2 to 2; 1 of pure noise). Where
odd and even rows were taken at two times, what moves is a comb, and rows two apart are of one time
(R .3 to .8). What files say of themselves is often wrong, and FFmpeg's `idet` weighs the whole
picture, in which something small that moves counts for nothing. Where what stands still is such a
comb as well, it is the pattern of a palette (GIF). Which field is first: the later one
of a picture is nearer to the earlier one of the next, also where what moves has gone by more than
its size, if what differs is blurred.

Limits: what moves by less than a pixel from field to field makes no comb.
"""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

WOVEN = 0.9  # R of what is woven is smaller
MOVED_GREY = 12  # pixels that change by less may be noise
LEAST_PIXELS = 200  # that moved, in the whole film; fewer tell nothing
BLUR = 8  # of the picture's sides, over which fields are blurred before they are compared
COLUMNS = 4  # of which one is enough to tell which field is first
Rows = Float[np.ndarray, "sum"]
NO_ROWS: Rows = np.zeros(7)


def rows_of(before: UInt8[np.ndarray, "row column"], grey: UInt8[np.ndarray, "row column"]) -> Rows:
    """Sums over pixels, to be added up over a film; `first_field` reads them.

    Returns:
      differences of rows two apart and of neighbours, where something moved and elsewhere; those,
      blurred, to the picture before of this one's upper field (from the lower one there) and of its
      lower field (from the upper one there); the number of pixels.
    """
    if before.shape != grey.shape or len(grey) < 4:
        return NO_ROWS
    moved = cv2.threshold(cv2.absdiff(grey, before), MOVED_GREY, 255, cv2.THRESH_BINARY)[1]
    still = cv2.bitwise_not(cv2.dilate(moved, np.ones((5, 1), np.uint8)))[:-2]
    even = len(grey) // 2 * 2
    upper, lower = grey[0:even:2], grey[1:even:2]
    return np.array(
        [
            *_sums(grey[:-2], grey[2:], moved[:-2], still),
            *_sums(grey[:-2], grey[1:-1], moved[:-2], still),
            _blurred(before[1:even:2], upper),
            _blurred(before[0:even:2], lower),
            cv2.countNonZero(moved),
        ]
    )


def first_field(rows: Rows) -> str | None:
    """Which field was taken first, the upper ("tff") or the lower one ("bff"); None: no fields."""
    two_apart, still_apart, neighbours, still_neighbours, to_upper, to_lower, count = rows
    if count < LEAST_PIXELS or two_apart >= WOVEN * neighbours:
        return None
    if still_apart < WOVEN * still_neighbours:
        return None
    return "tff" if to_upper <= to_lower else "bff"


def _sums(one: np.ndarray, other: np.ndarray, *masks: np.ndarray) -> list[float]:
    differs = cv2.absdiff(one, other)
    return [cv2.sumElems(cv2.bitwise_and(differs, mask))[0] for mask in masks]


def _blurred(one: np.ndarray, other: np.ndarray) -> float:
    differs = cv2.subtract(one[:, ::COLUMNS].copy(), other[:, ::COLUMNS].copy(), dtype=cv2.CV_32F)
    height, width = differs.shape
    return cv2.norm(cv2.blur(differs, (width // BLUR + 1, height // BLUR + 1)), cv2.NORM_L1)

"""The view of an object in its own colour, in which another that touches it looks like the scene.

    view = SCENE + w' (colour - scene),    w = d - (d' e) e,    |e| = 1

d: how the object's colour differs from the scene's; e: the direction in which the other's does. A
plain object is known by its edges alone, and where two touch, each has an edge of the other's.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float

from galileo_jax.tracking.fragments import Start
from galileo_jax.tracking.picture import OpenFrames, frames_at, mixture
from galileo_jax.tracking.pose import corners
from galileo_jax.tracking.template import RIM_SHARE, WINDOW_PX, Outline, grey, is_plain, template_at

SCENE, MOST = 64.0, 128.0  # levels of the view: the scene's, and how far the object is from it
LEAST = 40.0  # levels by which an object must differ from both
EVEN = 0.125  # of that, by which its middle may scatter
HALF_PX = 4  # of the middle
ALL_ROUND = 1.1  # times as far as the edge that is farthest from the mark


def in_own_colours(open_frames: OpenFrames, starts: Sequence[Start]) -> list[Start]:
    """Where objects are first seen, each plain one of several with the view in its own colour."""
    if len(starts) < 2:
        return list(starts)
    kept = frames_at(open_frames, {start.first_frame for start in starts})
    marked = [_marked(kept.get(start.first_frame), start) for start in starts]
    known = [one for one in marked if one is not None]
    if len(known) < len(starts):
        return list(starts)
    return [
        _in_own_colour(start, own, [other.colour for other in known if other is not own])
        for start, own in zip(starts, known, strict=True)
    ]


class _Marked(NamedTuple):
    """An object where it is first seen; colours are (blue, green, red), levels."""

    frame: np.ndarray
    scene: Float[np.ndarray, "3"]  # the frame's usual colour
    middle: Float[np.ndarray, "pixel 3"]  # the object's, less the scene's

    @property
    def colour(self) -> Float[np.ndarray, "3"]:
        """That of its middle, less the scene's."""
        return np.median(self.middle, axis=0)


def _marked(frame: np.ndarray | None, start: Start) -> _Marked | None:
    """An object's colours; None: it is not in the picture, or all is grey."""
    if frame is None or frame.ndim < 3:
        return None
    x, y = (round(one) for one in start.point_px)
    low = max(y - HALF_PX, 0), max(x - HALF_PX, 0)
    middle = frame[low[0] : y + HALF_PX + 1, low[1] : x + HALF_PX + 1].reshape(-1, 3)
    scene = np.median(frame[::4, ::4].reshape(-1, 3), axis=0)
    return _Marked(frame, scene, middle - scene) if len(middle) else None


def _in_own_colour(start: Start, own: _Marked, others: Sequence[Float[np.ndarray, "3"]]) -> Start:
    """An object with its view, and its size by that; as it is where it has texture.

    `others`: the colours of the others, less the scene's.
    """
    width, height = start.outline.size_px or (WINDOW_PX, WINDOW_PX)
    middle = replace(start.outline, size_px=(width / 2, height / 2))
    if not is_plain(template_at(grey(own.frame), np.array(start.point_px), middle)):
        return start
    weights = own.colour
    for other in others:
        if (size := float(np.linalg.norm(other))) > LEAST:
            weights = weights - (weights @ other) * other / size**2
    size = float(np.linalg.norm(weights))
    if size < LEAST or (own.middle @ weights / size).std() > EVEN * size:
        return start
    mixed = min(1.0, MOST / size) * weights / size
    outline, offset = start.outline, SCENE - float(mixed @ own.scene)
    if outline.size_px is None:
        off = np.linalg.norm(own.frame - own.scene - own.colour, axis=2)
        outline = _seen(off < size / 2, start.point_px, outline)
    return replace(start, view=mixture(mixed, offset), outline=outline)


def _seen(mask: np.ndarray, point_px: tuple[float, float], outline: Outline) -> Outline:
    """An outline with the size of the part at a point, so large that all its edge is compared."""
    parts = cv2.connectedComponents(mask.astype(np.uint8))[1]
    x, y = (round(one) for one in point_px)
    rows, columns = np.nonzero(parts == parts[y, x])
    low, high = corners(np.column_stack([columns, rows]) - point_px, outline.angle_rad)
    width, height = np.maximum(high - low + 1, ALL_ROUND * 2 * np.maximum(-low, high) / RIM_SHARE)
    if not mask[y, x] or min(width, height) < 2 * HALF_PX:
        return outline
    if outline.is_round:
        width = height = max(width, height)
    return replace(outline, size_px=(float(width), float(height)))

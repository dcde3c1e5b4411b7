"""The angle of a ramp that was read off a picture whose camera is not square to it."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.clip.picture_plane import PicturePlane, nearby_planes, picture_plane
from galileo_jax.clip.schema import Clip


def ramp_in_plane(clip: Clip, line: Sequence[float]) -> dict[str, Any]:
    """`ramp_angle_deg` and its standard deviation, by the declared rectangle or lens.

    Args:
      clip: with one of these.
      line: (x1, y1, x2, y2), px, on the ramp. Half a pixel of each of its coordinates and of the
        rectangle's, and what is open of the lens, make up the standard deviation.
    """
    ends = np.array(line, float).reshape(2, 2)
    angle = _angle_deg(picture_plane(clip, ends[0]), ends)
    apart = [
        _angle_deg(picture_plane(clip, ends[0]), ends + step)
        - _angle_deg(picture_plane(clip, ends[0]), ends - step)
        for step in CLICK_SD_PX * np.eye(4).reshape(4, 2, 2)
    ]
    for more, less in nearby_planes(clip, ends[0]):
        apart.append(_angle_deg(more, ends) - _angle_deg(less, ends))
    read_off = math.hypot(*apart) / 2
    return {"ramp_angle_deg": round(angle, 3), "ramp_angle_sd_deg": float(f"{read_off:.3g}")}


def _angle_deg(plane: PicturePlane, ends: np.ndarray) -> float:
    x, y = np.diff(plane.to_metres(ends), axis=0)[0]
    return math.degrees(math.atan2(abs(y), abs(x)))

"""A track: where each object was in every frame, in pixels, with an error."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float


@dataclass(frozen=True)
class Track:
    """Pixel positions of the objects in every frame.

    The only thing that tracking hands on; pixels end in `observation`.

    Attributes:
      names: the objects' names, in the clip's order.
      times_s: `[frame]`, seconds since the first frame.
      position_px: `[object, frame, 2]`, x right and y down. The point followed is the one
        the clip declares (`point_px`), or the object's centre when it declares none;
        NaN where not visible.
      covariance_px2: `[object, frame, 2, 2]`, the error's covariance of each point.
      common_px2: the same shape, how much of that is one error of the object's first frame, which
        all its points have in common and which turns with it; 0 where pieces follow each other.
      shifts_px: `[object, frame, pattern, 2]`, errors that follow each other: by how much a coder
        may shift what moves beside what was taken off. Each pattern has a size of its own, about
        standard normal, that wanders (`motion_compensation.LASTS_FRAMES`).
      angle_rad: `[object, frame]`, rotation in the image since the first frame,
        clockwise positive (x right, y down).
      is_visible: `[object, frame]`, False where the object is hidden or was lost.
      frame_size_px: (width, height).
    """

    names: tuple[str, ...]
    times_s: Float[np.ndarray, " frame"]
    position_px: Float[np.ndarray, "object frame 2"]
    covariance_px2: Float[np.ndarray, "object frame 2 2"]
    common_px2: Float[np.ndarray, "object frame 2 2"]
    shifts_px: Float[np.ndarray, "object frame pattern 2"]
    angle_rad: Float[np.ndarray, "object frame"]
    is_visible: Bool[np.ndarray, "object frame"]
    frame_size_px: tuple[int, int]

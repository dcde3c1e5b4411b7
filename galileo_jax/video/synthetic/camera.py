"""The camera: from metres in the plane of motion to pixels."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Camera:
    """A camera that looks at the plane of motion from the side, perhaps not quite squarely.

    Pixels as in OpenCV: x right, y down, whole numbers at the middle of a pixel.

    Attributes:
      pixels_per_metre: scale at the origin.
      origin_px: where the foot of the ramp at table level is.
      size_px: (width, height).
      direction: which way x grows in the image.
      keystone_per_m: (along x, along y), 1/m: how much farther away, relative to its
        distance at the origin, the plane is per metre; 0 is a camera held squarely.
      roll_rad: how far the picture is turned about the origin, counter-clockwise.
    """

    pixels_per_metre: float
    origin_px: tuple[float, float]
    size_px: tuple[int, int] = (640, 360)
    direction: Literal["right", "left"] = "right"
    keystone_per_m: tuple[float, float] = (0.0, 0.0)
    roll_rad: float = 0.0

    @property
    def world_to_image(self) -> np.ndarray:
        """The homography `[3, 3]` from (x, y, 1) in metres to pixels."""
        sign = 1.0 if self.direction == "right" else -1.0
        scale = self.pixels_per_metre
        about_origin = np.array(
            [[sign * scale, 0.0, 0.0], [0.0, -scale, 0.0], [*self.keystone_per_m, 1.0]]
        )
        to_origin = np.array(
            [[1.0, 0.0, self.origin_px[0]], [0.0, 1.0, self.origin_px[1]], [0, 0, 1]]
        )
        cos, sin = np.cos(self.roll_rad), np.sin(self.roll_rad)
        rolled = np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
        return to_origin @ rolled @ about_origin

    def project(self, points_m: np.ndarray) -> np.ndarray:
        """Returns the pixels `[..., 2]` of the points `[..., 2]` in metres."""
        return project(self.world_to_image, points_m)


def project(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Applies a homography `[3, 3]` to points `[..., 2]`."""
    mapped = np.asarray(points) @ homography[:, :2].T + homography[:, 2]
    return mapped[..., :2] / mapped[..., 2:]

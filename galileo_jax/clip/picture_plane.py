"""Between pixels and metres in the plane of the motion.

    plain:             x = +-(px - origin) / scale,   y = (origin - py) / scale
    with a rectangle:  (x, y) = +-(H(px) - H(origin)),  H the homography of its corners

after a lens, where one is declared, has been taken out.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.clip.schema import Clip
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M

LENS_CRITERIA = (3, 100, 1e-12)  # both, of OpenCV: so many iterations, or so close
SMALL_PX = 0.01  # of differences

Points = Float[np.ndarray, "*point 2"]


@dataclass(frozen=True)
class PicturePlane:
    """A map between pixels and metres, both ways."""

    origin_px: tuple[float, float]  # where x and y are 0
    sign: float  # 1 where x, along the travel, is to the right in the picture, else -1
    scale: float  # pixels per metre, where there is no homography
    # from pixels without the lens to metres right and up; None: the camera is square to the plane
    homography: Float[np.ndarray, "3 3"] | None = None
    k1: float = 0.0  # of the lens, 0 without one
    # the lens's middle, and the unit of its r
    middle_px: tuple[float, float] = (0.0, 0.0)
    unit_px: float = 1.0

    def to_metres(self, points_px: Points) -> Points:
        """Places along the travel and up; NaN where the plane is not seen."""
        points, origin = self._straight(points_px), self._straight(np.asarray(self.origin_px))
        if self.homography is None:
            return (points - origin) * (self.sign, -1.0) / self.scale
        away = _projected(self.homography, points) - _projected(self.homography, origin)
        return away * (self.sign, 1.0)

    def to_pixels(self, points_m: Points) -> Points:
        """The way back."""
        origin = self._straight(np.asarray(self.origin_px))
        if self.homography is None:
            straight = np.asarray(points_m) * (self.sign * self.scale, -self.scale) + origin
        else:
            upright = np.asarray(points_m) * (self.sign, 1.0) + _projected(self.homography, origin)
            straight = _projected(np.linalg.inv(self.homography), upright)
        if not self.k1:
            return straight
        away = (straight - self.middle_px) / self.unit_px
        longer = 1 + self.k1 * (away**2).sum(axis=-1, keepdims=True)
        return away * longer * self.unit_px + self.middle_px

    def slope(self, points_px: Points) -> Float[np.ndarray, "*point 2 2"]:
        """The derivative of `to_metres`, m per px: `[..., metres' axis, pixels' axis]`."""
        if self.homography is None and not self.k1:
            plain = np.diag([self.sign, -1.0]) / self.scale
            return np.broadcast_to(plain, (*np.shape(points_px), 2))
        sides = [
            self.to_metres(points_px + step) - self.to_metres(points_px - step)
            for step in SMALL_PX * np.eye(2)
        ]
        return np.stack(sides, axis=-1) / (2 * SMALL_PX)

    def _straight(self, points_px: Points) -> Points:
        """Where a lens that does not bend would show them."""
        points = np.asarray(points_px, float)
        if not self.k1:
            return points
        import cv2

        (x, y), unit = self.middle_px, self.unit_px
        camera = np.array([[unit, 0.0, x], [0.0, unit, y], [0.0, 0.0, 1.0]])
        lens = np.array([self.k1, 0.0, 0.0, 0.0])
        flat = points.reshape(-1, 1, 2)
        found = cv2.undistortPoints(flat, camera, lens, P=camera, criteria=LENS_CRITERIA)
        return found.reshape(points.shape)


def picture_plane(clip: Clip, origin_px: Sequence[float] | np.ndarray) -> PicturePlane:
    """The map that a clip declares, x and y being 0 at `origin_px`.

    Without a rectangle and a scale lengths are in nominal metres.
    """
    lens: dict[str, Any] = {}
    if clip.lens is not None:
        assert clip.frame_size_px is not None  # `load` asks for a video
        width, height = clip.frame_size_px
        lens = {
            "k1": clip.lens.k1,
            "middle_px": ((width - 1) / 2, (height - 1) / 2),
            "unit_px": math.hypot(width, height) / 2,
        }
    scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
    plane = PicturePlane((float(origin_px[0]), float(origin_px[1])), clip.sign, scale, **lens)
    if clip.rectangle is None:
        return plane
    import cv2

    width, height = clip.rectangle.sides_m
    metres = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    straight = plane._straight(np.asarray(clip.rectangle.corners_px)).astype(np.float32)
    return replace(plane, homography=cv2.getPerspectiveTransform(straight, metres))


def nearby_planes(
    clip: Clip, origin_px: Sequence[float] | np.ndarray
) -> list[tuple[PicturePlane, PicturePlane]]:
    """The map with each declared number one standard deviation larger, and smaller."""

    def plane(key: str, **other: Any) -> PicturePlane:
        declared = getattr(clip, key).model_copy(update=other)
        return picture_plane(clip.model_copy(update={key: declared}), origin_px)

    found = []
    if clip.rectangle is not None:
        corners = np.array(clip.rectangle.corners_px)
        for step in CLICK_SD_PX * np.eye(corners.size).reshape(-1, *corners.shape):
            found.append(tuple(plane("rectangle", corners_px=corners + s * step) for s in (1, -1)))
    if clip.lens is not None and clip.lens.k1_sd:
        k1s = (clip.lens.k1 + s * clip.lens.k1_sd for s in (1, -1))
        found.append(tuple(plane("lens", k1=k1) for k1 in k1s))
    return found


def scale_of_rectangle(clip: Clip) -> float:
    """Pixels per metre in the middle of the declared rectangle, the mean of all directions."""
    assert clip.rectangle is not None
    middle = np.mean(clip.rectangle.corners_px, axis=0)
    slope = picture_plane(clip, middle).slope(middle)
    return float(1 / np.sqrt(abs(np.linalg.det(slope))))


def _projected(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    points = np.asarray(points, float)
    mapped = points @ homography[:, :2].T + homography[:, 2]
    # Beyond the horizon a plane is not seen.
    depth = np.where(mapped[..., 2:] > 0, mapped[..., 2:], np.nan)
    return mapped[..., :2] / depth

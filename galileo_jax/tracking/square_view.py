"""The picture as a camera square to the plane would show it.

A camera that looks at the plane from aside draws an object smaller, and sheared, the further it
goes: whatever is followed as a rigid pattern would drift within it. So frames are drawn square
first, by the declared rectangle and lens, and the track is put back into the picture's pixels.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float

from galileo_jax.clip.picture_plane import PicturePlane, picture_plane
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.tracking.track import Track

LARGEST = 2.0  # of the picture's own size: far parts of an oblique plane would fill a wall
OUTSIDE = -1e4  # a pixel that is in no picture
Place = tuple[float, float]


@dataclass(frozen=True)
class SquareView:
    """How the picture's pixels and those of the square view belong together."""

    plane: PicturePlane  # the picture's pixels to metres
    view: PicturePlane  # the view's pixels to metres
    size_px: tuple[int, int]  # of the view

    def from_picture(self, points_px: Float[np.ndarray, "*point 2"]) -> np.ndarray:
        """Pixels of the picture to those of the view."""
        return self.view.to_pixels(self.plane.to_metres(points_px))

    def to_picture(self, points_px: Float[np.ndarray, "*point 2"]) -> np.ndarray:
        """The way back; NaN where the picture does not show the plane."""
        return self.plane.to_pixels(self.view.to_metres(points_px))

    def shown(self, place_px: Place | None) -> Place | None:
        """Where the picture shows a place of the view; None for None."""
        return place_px and _mapped(self.to_picture, place_px)

    def drawn(self, frames: Iterator[np.ndarray]) -> Iterator[np.ndarray]:
        """Frames of the picture as the view shows them."""
        width, height = self.size_px
        grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1)
        at = np.nan_to_num(self.to_picture(grid), nan=OUTSIDE).astype(np.float32)
        for frame in frames:
            yield cv2.remap(frame, at[..., 0], at[..., 1], cv2.INTER_CUBIC)

    def clip(self, clip: Clip) -> Clip:
        """The clip as if it had been filmed square."""

        def moved(item: ClipObject) -> ClipObject:
            there = item.point_px and _mapped(self.from_picture, item.point_px)
            later = ((at, *_mapped(self.from_picture, (x, y))) for at, x, y in item.corrections)
            return item.model_copy(update={"point_px": there, "corrections": tuple(later)})

        origin_px = clip.origin_px and _mapped(self.from_picture, clip.origin_px)
        objects = tuple(map(moved, clip.objects))
        square = {"rectangle": None, "lens": None, "frame_size_px": self.size_px}
        return clip.model_copy(update=square | {"objects": objects, "origin_px": origin_px})

    def track(self, found: Track, clip: Clip) -> Track:
        """A track of the view, in the picture's pixels."""
        position = self.to_picture(found.position_px)
        # Pixels to view: the slopes of both maps to metres.
        back = np.linalg.inv(np.nan_to_num(self.plane.slope(position), nan=1.0))
        back = back @ self.view.slope(found.position_px)
        covariance, common = (
            back @ each @ np.swapaxes(back, -1, -2)
            for each in (found.covariance_px2, found.common_px2)
        )
        shifts = np.einsum("ofij,ofpj->ofpi", back, found.shifts_px)
        assert clip.frame_size_px is not None  # of a video
        return replace(
            found,
            position_px=position,
            covariance_px2=covariance,
            common_px2=common,
            shifts_px=shifts,
            frame_size_px=clip.frame_size_px,
        )


def _mapped(by: Callable[[np.ndarray], np.ndarray], place_px: Place) -> Place:
    """A place of a picture in another."""
    x, y = by(np.array(place_px))
    return float(x), float(y)


def square_view(clip: Clip) -> SquareView:
    """The view of a clip with a rectangle or a lens, about the middle of either."""
    assert clip.frame_size_px is not None  # of a video
    width, height = clip.frame_size_px
    edges = np.array([[0, 0], [width, 0], [width, height], [0, height]], float)
    corners = edges if clip.rectangle is None else np.array(clip.rectangle.corners_px)
    middle = corners.mean(axis=0)
    plane = picture_plane(clip, middle)
    plain = clip.model_copy(update={"rectangle": None, "lens": None})
    whole = picture_plane(plain, (0.0, 0.0)).to_pixels(plane.to_metres(edges))
    reach = LARGEST / 2 * np.array([width, height])
    # Edges beyond the horizon are not there.
    whole = np.where(np.isfinite(whole), whole, np.sign(edges - middle) * reach)
    low = np.maximum(np.floor(whole.min(axis=0)), -reach)
    high = np.minimum(np.ceil(whole.max(axis=0)), reach)
    # An even number of pixels, as video has.
    size = (2 * np.ceil((high - low) / 2)).astype(int)
    return SquareView(plane, picture_plane(plain, -low), (int(size[0]), int(size[1])))

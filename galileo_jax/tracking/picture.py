"""A grey frame that is read, smoothed, at any place between its pixels; and some of a film."""

from collections.abc import Callable, Iterable, Set

import cv2
import numpy as np

from galileo_jax.tracking.pose import SHARP_PX, smeared_along, square_around

MARGIN_PX = 6  # by which an object may move before more of the frame is smoothed
UPSAMPLED_TO_PX = 2.0  # what is smoothed less than this is kept at twice the frame's resolution
PYRAMID_VARIANCE_PX2 = 0.25  # of OpenCV's `pyrUp`, which smooths half pixels by (1 4 6 4 1) / 16
LINEAR_SHARE = 1 / 6  # of h^2: the variance of linear interpolation between samples h apart
SAME_SMEAR_PX, MAX_SMEARED = 0.5, 8  # smears alike to this are made once; so many are kept
MOST_PLACES = 2**14  # in one row of OpenCV's `remap`, which takes less than 2^15

SOME_FRAMES = 15  # evenly over a film, show what stands still in it

OpenFrames = Callable[[], Iterable[np.ndarray]]
"""Gives the frames of a film from its beginning, BGR or grey."""

View = Callable[[np.ndarray], np.ndarray]
"""Makes one colour, `[height, width]` uint8, of a frame."""


def mixture(weights: np.ndarray, offset: float) -> View:
    """The view offset + weights' (blue, green, red), levels."""
    row = np.array([[*weights, offset]])
    return lambda frame: cv2.transform(frame, row)


def frames_at(open_frames: OpenFrames, chosen: Set[int]) -> dict[int, np.ndarray]:
    """By their numbers the chosen frames of a film, as far as it has them."""
    frames = zip(range(max(chosen, default=-1) + 1), open_frames(), strict=False)
    return {index: frame for index, frame in frames if index in chosen}


def some_frames(open_frames: OpenFrames, count: int) -> dict[int, np.ndarray]:
    """By their numbers `SOME_FRAMES` of the `count` frames of a film, the first among them."""
    chosen = np.linspace(0, count - 1, min(count, SOME_FRAMES)).astype(int).tolist()
    return frames_at(open_frames, set(chosen))


class Picture:
    """One frame, with the smoothed windows that were last read.

    A window is doubled in size and smoothed once; its values at any number of places then cost
    microseconds (linear interpolation between half pixels that a Gaussian of 0.8 px has smoothed
    shifts nothing, and what it blurs is subtracted from the Gaussian). Smoothing every sampled
    patch anew, after Lanczos interpolation, took 60 times as long.
    """

    def __init__(self, grey: np.ndarray):
        """The frame, `[height, width]` uint8."""
        self.grey = grey
        self.size_px = grey.shape[1], grey.shape[0]
        self._windows: dict[float, _Window] = {}
        self._smeared: dict[tuple[float, float], Picture] = {}

    def window(self, low: np.ndarray, high: np.ndarray) -> np.ndarray | None:
        """The pixels from `low` to `high` (x, y), both within, float32; None: not all are seen."""
        (left, top), (right, bottom) = low, high
        if (low < 0).any() or (high >= self.size_px).any():
            return None
        return self.grey[top : bottom + 1, left : right + 1].astype(np.float32)

    def smeared(self, shift: np.ndarray) -> "Picture":
        """The picture as it were if all in it moved by `shift` (x, y), px, in the exposure."""
        x, y = (SAME_SMEAR_PX * round(float(part) / SAME_SMEAR_PX) for part in shift)
        if np.hypot(x, y) < SHARP_PX:
            return self
        if (x, y) not in self._smeared:
            if len(self._smeared) >= MAX_SMEARED:
                self._smeared.clear()
            self._smeared[x, y] = Picture(smeared_along(self.grey, np.array([x, y])))
        return self._smeared[x, y]

    def at(self, pose: np.ndarray, own: np.ndarray, reach_px: float, width_px: float) -> np.ndarray:
        """The values at places of an object, smoothed by a Gaussian, `[place]` float32.

        `own` `[2, place]` are the places in the axes of the pose `(x, y, angle)`, none farther than
        `reach_px` from its point; `width_px` of the Gaussian is at least 0.6. Beyond its border the
        frame is continued by its last pixels.
        """
        window = self._windows.get(width_px)
        if window is None or not window.holds(pose[:2], reach_px):
            window = self._windows[width_px] = _Window(self.grey, pose[:2], reach_px, width_px)
        return window.at(pose[:2], pose[2], own)


class _Window:
    """What lies around a place, smoothed."""

    def __init__(self, grey: np.ndarray, place: np.ndarray, reach_px: float, width_px: float):
        self._middle, self._reach_px = place, reach_px
        reach = int(np.ceil(reach_px + MARGIN_PX + 3 * width_px)) + 1
        cut, self._corner = square_around(grey, place, reach)
        pixels, self._scale, variance = cut.astype(np.float32), 1, width_px**2
        if width_px < UPSAMPLED_TO_PX:
            pixels, self._scale = cv2.pyrUp(pixels), 2
            variance -= PYRAMID_VARIANCE_PX2
        sd = np.sqrt(variance * self._scale**2 - LINEAR_SHARE)
        kernel = cv2.getGaussianKernel(2 * int(np.ceil(3.5 * sd)) + 1, sd, cv2.CV_32F)
        self._pixels = cv2.sepFilter2D(pixels, -1, kernel, kernel, borderType=cv2.BORDER_REPLICATE)

    def holds(self, place: np.ndarray, reach_px: float) -> bool:
        """Whether everything that far from the place is in it, smoothed as it should be."""
        moved = max(abs(place[0] - self._middle[0]), abs(place[1] - self._middle[1]))
        return bool(moved + reach_px <= self._reach_px + MARGIN_PX)

    def at(self, place: np.ndarray, angle_rad: float, own: np.ndarray) -> np.ndarray:
        c, s = self._scale * np.cos(angle_rad), self._scale * np.sin(angle_rad)
        left = self._scale * (place[0] - self._corner[0])
        top = self._scale * (place[1] - self._corner[1])
        x, y = own
        places_x = np.float32(c) * x - np.float32(s) * y + np.float32(left)
        places_y = np.float32(s) * x + np.float32(c) * y + np.float32(top)

        def of(part: slice) -> np.ndarray:
            return cv2.remap(
                self._pixels,
                places_x[None, part],
                places_y[None, part],
                cv2.INTER_LINEAR,
                borderMode=cv2.BORDER_REPLICATE,
            )[0]

        if len(x) <= MOST_PLACES:
            return of(slice(None))
        begins = range(0, len(x), MOST_PLACES)
        return np.concatenate([of(slice(begin, begin + MOST_PLACES)) for begin in begins])

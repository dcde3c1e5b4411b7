"""A camera that moves: how each picture lies against the first, by what stands still in both.

    picture(H x) ~ gain first(x) + offset      x: a place in the first picture, homogeneous

A homography H is exact for a camera that turns on the spot, and for a plane however it is filmed.
Each is found by direct alignment with the first, not from one to the next, so that errors do not
add up (inverse-compositional Gauss-Newton, Tukey's weights, from coarse to fine). The pixels that
count are the steepest of each cell of a grid, a wall's as many as a ball's: what moves on its own
is outvoted.

Source: S. Baker, I. Matthews, "Lucas-Kanade 20 Years On: A Unifying Framework", Int. J. Computer
Vision 56 (2004), doi:10.1023/B:VISI.0000011205.11775.fd.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float

WIDEST_PX = 640  # pictures are made so small: their many slopes tell hundredths of a pixel
LEVELS = 4  # each half as large as the one before
CELLS, OF_CELL = 20, 60  # along the longer side of a picture; pixels of each at most
BLUR_PX = 1.0
NOISE_GREY, SHIFT_PX = 2.0, 0.2  # by which a pixel is off: in brightness, and in place
LEAST_SLOPE = 2.0  # grey levels per pixel: below, noise and coding hide it
TUKEY = 4.7  # standard deviations at which a pixel no longer counts
MOST_STEPS, STILL_PX = 12, 0.005
ALIKE = 0.6  # of the pixels: where fewer agree, what stands still is not found
DIMMED = np.log(2.0)  # of a picture's contrast: what is paler, as fog, shows something else
LEFT = 0.5  # of the first picture's pixels: when fewer are seen, the camera pans away
GLIMPSES, KNOWN = 16, 0.5  # pictures that tell whether a camera moves; of how many they must
# Of the small pictures, px: how well their corners are known, and by what rms a camera moves; less
# is among the errors that a track has anyhow.
TOLD_PX, LEAST_PX = 0.3, 0.3
# Of a camera's motion, beside a shift, a turn and a zoom: a lens a picture wide makes a tenth.
UNLIKE = 0.25
GRID = 5  # places along either side of a picture

Homography = Float[np.ndarray, "3 3"]
Homographies = Float[np.ndarray, "picture 3 3"]


@dataclass
class Glimpses:
    """Some small grey pictures, evenly over a film of unknown length."""

    kept: list[np.ndarray] = field(default_factory=list)
    _every: int = 1
    _count: int = 0

    def add(self, grey: np.ndarray) -> None:
        """The film's next picture."""
        if self._count % self._every == 0:
            self.kept.append(small(grey))
            if len(self.kept) == 2 * GLIMPSES:
                self.kept, self._every = self.kept[::2], 2 * self._every
        self._count += 1

    def camera_moves(self, used: Bool[np.ndarray, " picture"]) -> bool:
        """Whether pictures move as a camera's do, of those `used` of the film."""
        own = used[:: self._every][: len(self.kept)]
        found = list(to_first(one for one, is_used in zip(self.kept, own, strict=True) if is_used))
        known = [one for one in found if one is not None]
        return len(known) > KNOWN * len(found) and _is_a_cameras(
            np.array(known), self.kept[0].shape
        )


def small(grey: np.ndarray) -> np.ndarray:
    """A picture `[height, width]` uint8 as large as is looked at."""
    scale = min(1.0, WIDEST_PX / grey.shape[1])
    return cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def to_first(pictures: Iterable[np.ndarray]) -> Iterator[Homography | None]:
    """From each of small grey pictures to the first, px; None: what stands still is not found."""
    first, there = None, np.eye(3)
    for picture in pictures:
        levels = _pyramid(picture)
        if first is None:
            first = [_still(level) for level in levels]
        found = _aligned(first, levels, there)
        if found is None:
            yield None
            continue
        there = found
        yield np.linalg.inv(there)


def enlarged(homographies: Homographies, factor: float) -> Homographies:
    """The same of pictures that are `factor` times as wide; pixels' middles are whole numbers."""
    shift = (factor - 1) / 2
    wider = np.array([[factor, 0, shift], [0, factor, shift], [0, 0, 1]])
    return wider @ homographies @ np.linalg.inv(wider)


def drawn(pictures: Iterable[np.ndarray], homographies: Homographies) -> Iterator[np.ndarray]:
    """Pictures as a camera would have taken them that rests where it took the first.

    What a picture no longer shows is as it was when it was last seen.
    """
    before = None
    for picture, one in zip(pictures, homographies, strict=False):
        before = picture.copy() if before is None else before.copy()
        cv2.warpPerspective(
            picture, one, picture.shape[1::-1], before, cv2.INTER_CUBIC, cv2.BORDER_TRANSPARENT
        )
        yield before


def displacements_px(
    homographies: Homographies, shape: tuple[int, ...]
) -> Float[np.ndarray, "picture place 2"]:
    """Of places evenly over pictures of a shape `(height, width)`."""
    places = _grid(shape)
    there = homographies @ places
    return np.moveaxis(there[:, :2] / there[:, 2:] - places[:2], 1, 2)


def _grid(shape: tuple[int, ...]) -> Float[np.ndarray, "3 place"]:
    """Places evenly over a picture, homogeneous, px."""
    height, width = shape
    x, y = np.meshgrid(np.linspace(0, width, GRID), np.linspace(0, height, GRID))
    return np.stack([x.ravel(), y.ravel(), np.ones(x.size)])


def _is_a_cameras(homographies: Homographies, shape: tuple[int, ...]) -> bool:
    """Whether they are as large as a moving camera's, and not unlike them."""
    off = displacements_px(homographies, shape)
    x, y, one = _grid(shape)
    along = np.stack([one, 0 * one, x, -y]), np.stack([0 * one, one, y, x])
    similar, _ = np.linalg.qr(np.concatenate(along, axis=1).T)
    every = np.concatenate([off[..., 0], off[..., 1]], axis=1)
    left = every - every @ similar @ similar.T
    return bool(np.mean(off**2) > LEAST_PX**2 and np.sum(left**2) < UNLIKE**2 * np.sum(every**2))


class _Still(NamedTuple):
    """Pixels of a picture that tell a shift."""

    places: Float[np.ndarray, "3 pixel"]  # of `_unit`, homogeneous
    values: Float[np.ndarray, " pixel"]  # grey levels
    design: Float[np.ndarray, "pixel 10"]  # slopes by H's entries but the last, gain and offset
    sd: Float[np.ndarray, " pixel"]  # grey levels


def _pyramid(picture: np.ndarray) -> list[np.ndarray]:
    """The picture, smoothed, and smaller ones."""
    levels: list[np.ndarray] = [picture.astype(np.float32)]
    for _ in range(LEVELS - 1):
        levels.append(cv2.pyrDown(levels[-1]))
    return [cv2.GaussianBlur(level, (0, 0), BLUR_PX) for level in levels]


def _unit(shape: tuple[int, ...]) -> Homography:
    """From places about the middle, in half widths, to pixels of a picture."""
    height, width = shape
    half = width / 2
    return np.array([[half, 0, (width - 1) / 2], [0, half, (height - 1) / 2], [0, 0, 1]])


def _slopes(
    along_x: np.ndarray, along_y: np.ndarray, places: Float[np.ndarray, "3 pixel"]
) -> Float[np.ndarray, "pixel 8"]:
    """Of a shift's part along `(along_x, along_y)`, by H's entries but the last, round H = 1."""
    u, v, _ = places
    x, y = along_x, along_y
    both = x * u + y * v
    return np.stack([x * u, x * v, x, y * u, y * v, y, -both * u, -both * v], axis=1)


def _still(picture: np.ndarray) -> _Still:
    dx, dy = (
        cv2.Sobel(picture, cv2.CV_32F, *order, ksize=3, scale=1 / 8) for order in ((1, 0), (0, 1))
    )
    steep = np.hypot(dx, dy)
    height, width = picture.shape
    side, chosen = max(max(width, height) // CELLS, 2), []
    index = np.arange(height * width).reshape(height, width)
    for top in range(1, height - 1, side):
        for left in range(1, width - 1, side):
            own = index[top : min(top + side, height - 1), left : min(left + side, width - 1)]
            own = own.ravel()
            best = own[np.argsort(-steep.flat[own], kind="stable")[:OF_CELL]]
            chosen.append(best[steep.flat[best] > LEAST_SLOPE])
    at = np.concatenate(chosen)
    y, x = np.divmod(at, width)
    places = np.linalg.solve(_unit(picture.shape), np.stack([x, y, np.ones(len(at))]))
    values, sd = picture.flat[at], np.hypot(NOISE_GREY, SHIFT_PX * steep.flat[at])
    slopes = _slopes(width / 2 * dx.flat[at], width / 2 * dy.flat[at], places)
    design = np.column_stack([slopes, values, np.ones(len(at))]) / sd[:, None]
    return _Still(places, values, design, sd)


def _aligned(
    first: Sequence[_Still], levels: Sequence[np.ndarray], before: Homography
) -> Homography | None:
    """H from the first picture to another, px; `before`: about that."""
    unit = _unit(levels[0].shape)
    found, sd_px = np.linalg.solve(unit, before @ unit), np.inf
    for still, level in zip(reversed(first), reversed(levels), strict=True):
        found, sd_px = _fitted(still, level, found)
    return unit @ found @ np.linalg.inv(unit) if sd_px < TOLD_PX else None


def _fitted(still: _Still, picture: np.ndarray, homography: Homography) -> tuple[Homography, float]:
    """H of places of `_unit`, and the error of the picture's corners, px.

    That is inf where too little of what stands still is seen, or agrees.
    """
    height, width = picture.shape
    unit, sd_px, light = _unit(picture.shape), np.inf, np.zeros(2)
    for _ in range(MOST_STEPS):
        x, y, w = unit @ homography @ still.places
        x, y = (one / np.where(w > 0, w, np.inf) for one in (x, y))
        inside = (w > 0) & (x >= 0) & (x <= width - 1) & (y >= 0) & (y <= height - 1)
        design = still.design[inside]
        if len(design) < max(2 * design.shape[1], LEFT * len(inside)):
            return homography, np.inf
        own = np.stack([x[inside], y[inside]], axis=1).astype(np.float32)[:, None]
        there = cv2.remap(picture, own, None, cv2.INTER_LINEAR)[:, 0]  # pyright: ignore
        off = (there - still.values[inside]) / still.sd[inside] - design[:, 8:] @ light
        size = max(1.0, 1.4826 * float(np.median(np.abs(off - np.median(off)))))
        weight = np.maximum(1 - (off / (TUKEY * size)) ** 2, 0.0) ** 2
        weighed = design * weight[:, None]
        normal = weighed.T @ design
        try:
            step, lighter = np.split(np.linalg.solve(normal, weighed.T @ off), [8])
            homography = homography @ np.linalg.inv(np.append(step, 0.0).reshape(3, 3) + np.eye(3))
            sd_px = size * _corner_sd(normal, height / width) * width / 2
        except np.linalg.LinAlgError:
            return homography, np.inf
        homography, light = homography / homography[2, 2], light + lighter
        is_alike = np.mean(weight > 0) > ALIKE and abs(np.log(max(1 + light[0], 1e-9))) < DIMMED
        sd_px = sd_px if is_alike else np.inf
        if np.abs(step).max() * width / 2 < STILL_PX:
            break
    return homography, sd_px


def _corner_sd(normal: Float[np.ndarray, "10 10"], height: float) -> float:
    """The largest error of a corner of the picture, in half widths; `height` by its width."""
    corners = np.array([[-1, 1, 1, -1], [-height, -height, height, height], [1, 1, 1, 1]])
    covariance, ones, none = np.linalg.inv(normal)[:8, :8], np.ones(4), np.zeros(4)
    both = _slopes(ones, none, corners), _slopes(none, ones, corners)
    variance = np.max(sum(np.einsum("ci,ij,cj->c", one, covariance, one) for one in both))
    return float(np.sqrt(variance)) if variance > 0 else np.inf

"""How motion compensation shifts what a video shows, and the places without it.

A coder predicts a moving block from the frame before it, shifted by a whole number of half pixels
(MPEG-4) or quarter pixels (H.264, H.265), and codes of the rest only what is large. So the picture
is drawn towards the nearest such step: an object whose displacement from frame to frame is d is
seen off its place by

    e = sum_k a_k sin(2 pi k d)      k = 2: half pixels, k = 4: quarter pixels

and not at all in frames that are coded whole. How strongly depends on coder and bit rate, but is
the same for all objects along both axes of the image. The a_k are found in the video itself, where
objects move smoothly: the largest likelihood of

    x_t = path_t + e(x_t - x_(t-1)) + noise

in short pieces, less a parabola each. Its Jacobian, 1 - e'(x_t - x_(t-1)), keeps noise in x_t,
which is in the displacement as well, from being taken for e.

Source: G. Sullivan, T. Wiegand, "Rate-Distortion Optimization for Video Compression", IEEE Signal
Processing Magazine 15 (1998) 74, doi:10.1109/79.733497 (motion-compensated prediction). The sine is
what was measured: docs/explanation/tracking.md.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import minimize

from galileo_jax.tracking.noise import has_moved

STEPS_PER_PX = np.array([2.0, 4.0])
USUAL_PX = 0.03
"""Prior standard deviation of the amplitudes: those of rendered MPEG-4 were 0.03 px."""
PIECE_FRAMES, DEGREE = 8, 2
MIN_PIECES = 3
"""Fewer pieces tell no amplitude."""
ROUGH = 6.0
"""A piece with so many times the usual mean square is left out: something was hit in it."""
MOST_ALIKE = 0.8
"""If displacements agree so well in where they lie between two half pixels (length of the mean
phasor), a piece tells nothing."""
SLOPE_MOST = 0.9
"""Of e': beyond 1, two places of the object would give the same picture."""
TURNS_RAD = 0.01
"""From a frame to the next: a third of a pixel at the rim of a middling object."""


def _same(place_px: np.ndarray) -> np.ndarray:
    return place_px


@dataclass(frozen=True)
class Coding:
    """How the frames that are tracked were coded.

    Attributes:
      is_predicted: `[frame]`, which frames a coder has predicted from the frame before them.
      to_coded: pixels of the frames that are tracked, `[*, 2]`, to those that were coded.
      from_coded: the way back.
    """

    is_predicted: Bool[np.ndarray, " frame"]
    to_coded: Callable[[np.ndarray], np.ndarray] = _same
    from_coded: Callable[[np.ndarray], np.ndarray] = _same


def without_coding_shift(
    paths: Sequence[tuple[Float[np.ndarray, "frame 3"], Float[np.ndarray, "frame 2 2"]]],
    coding: Coding,
) -> list[Float[np.ndarray, "frame 3"]]:
    """The poses of all objects without what motion compensation shifts them.

    Args:
      paths: per object the poses as the frames show them (x and y in px, angle in rad) and
        `covariance` of image noise, px^2; NaN where not visible.
      coding: of as many frames or more.
    """
    shown = [(coding.to_coded(poses[:, :2]), covariance) for poses, covariance in paths]
    amplitudes_px = coding_shift_amplitudes_px(shown, coding.is_predicted)
    found = []
    for (poses, _), (coded, covariance) in zip(paths, shown, strict=True):
        step = _displacement(coded)
        predicted = _patterns(step, coding.is_predicted[: len(step)]) @ amplitudes_px
        # What does not move is shown where it was, and noise in its steps would only add noise.
        # What turns no shifted block predicts, so that it is coded anew.
        is_turning = np.abs(np.diff(poses[:, 2:], axis=0, prepend=np.nan)) > TURNS_RAD
        shift = np.where(_moves(coded, covariance) & ~is_turning, predicted, 0.0)
        is_shifted = shift.any(axis=1, keepdims=True)
        place = np.where(is_shifted, coding.from_coded(coded - shift), poses[:, :2])
        found.append(np.column_stack([place, poses[:, 2]]))
    return found


def coding_shift_amplitudes_px(
    paths: Sequence[tuple[Float[np.ndarray, "frame 2"], Float[np.ndarray, "frame 2 2"]]],
    is_predicted: Bool[np.ndarray, " frame"],
) -> Float[np.ndarray, " step"]:
    """The amplitudes a_k, px, for each of `STEPS_PER_PX`; 0 where too little moves to tell.

    Args:
      paths: per object `place`, px, and `covariance` of image noise, px^2; NaN where not visible.
      is_predicted: which frames are predicted from the frame before them.
    """
    off_path = _off_parabola()
    places, patterns, slopes = [], [], []
    for place, covariance in paths:
        step = _displacement(place)
        pattern = _patterns(step, is_predicted[: len(step)])
        slope = _slopes(step, is_predicted[: len(step)])
        moves = _moves(place, covariance)
        for axis in range(2):
            for own in _pieces(moves[:, axis]):
                if _alike(step[own, axis]) < MOST_ALIKE:
                    places.append(off_path @ place[own, axis])
                    patterns.append(off_path @ pattern[own, axis])
                    slopes.append(slope[own, axis])
    if len(places) < MIN_PIECES:
        return np.zeros(len(STEPS_PER_PX))
    left, pattern, slope = np.array(places), np.array(patterns), np.array(slopes)
    size = np.mean(left**2, axis=1)
    is_smooth = size < ROUGH * np.median(size)
    return _likeliest(left[is_smooth], pattern[is_smooth], slope[is_smooth])


def _likeliest(
    left: Float[np.ndarray, "piece frame"],
    pattern: Float[np.ndarray, "piece frame step"],
    slope: Float[np.ndarray, "piece frame step"],
) -> Float[np.ndarray, " step"]:
    """The most probable amplitudes, px; the noise's size is integrated out."""
    share = 1 - (DEGREE + 1) / PIECE_FRAMES  # of the values, what a parabola leaves
    degrees = share * left.size

    def cost(amplitudes: np.ndarray) -> float:
        square = np.sum((left - pattern @ amplitudes) ** 2)
        volume = share * np.sum(np.log(np.maximum(1 - slope @ amplitudes, 1e-3)))
        prior = np.sum(amplitudes**2) / (2 * USUAL_PX**2)
        return float(degrees / 2 * np.log(square + 1e-12) - volume + prior)

    most = SLOPE_MOST / (2 * np.pi * STEPS_PER_PX)
    bounds = list(zip(-most, most, strict=True))
    starts = (np.zeros(len(most)), -USUAL_PX / STEPS_PER_PX)
    ends = [minimize(cost, start, bounds=bounds) for start in starts]
    return np.asarray(min(ends, key=lambda end: float(end.fun)).x)


def _displacement(place: Float[np.ndarray, "frame 2"]) -> Float[np.ndarray, "frame 2"]:
    """From the frame before; NaN where either is not visible."""
    return np.diff(place, axis=0, prepend=np.nan)


def _patterns(
    step: Float[np.ndarray, "frame 2"], is_predicted: Bool[np.ndarray, " frame"]
) -> Float[np.ndarray, "frame 2 step"]:
    """The sines; 0 where nothing is known of the frame before."""
    phase = 2 * np.pi * STEPS_PER_PX * np.nan_to_num(step)[..., None]
    return np.where(is_predicted[:, None, None], np.sin(phase), 0.0)


def _slopes(
    step: Float[np.ndarray, "frame 2"], is_predicted: Bool[np.ndarray, " frame"]
) -> Float[np.ndarray, "frame 2 step"]:
    """The sines' derivatives by the displacement, 1/px."""
    rate = 2 * np.pi * STEPS_PER_PX
    slope = rate * np.cos(rate * np.nan_to_num(step)[..., None])
    return np.where(is_predicted[:, None, None] & np.isfinite(step)[..., None], slope, 0.0)


def _moves(
    place: Float[np.ndarray, "frame 2"], covariance: Float[np.ndarray, "frame 2 2"]
) -> Bool[np.ndarray, "frame 2"]:
    """Whether the step into a frame is beyond noise."""
    steps = has_moved(place, np.einsum("fii->fi", covariance))
    return np.pad(steps, ((len(place) - len(steps), 0), (0, 0)))


def _pieces(moves: Bool[np.ndarray, " frame"]) -> list[slice]:
    """Of each unbroken motion all that fit into it, one after the other."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moves, [False]]).astype(int)))
    return [
        slice(first, first + PIECE_FRAMES)
        for begin, end in edges.reshape(-1, 2)
        for first in range(begin, end - PIECE_FRAMES + 1, PIECE_FRAMES)
    ]


def _alike(step: Float[np.ndarray, " frame"]) -> float:
    return float(np.abs(np.mean(np.exp(2j * np.pi * STEPS_PER_PX[0] * step))))


def _off_parabola() -> Float[np.ndarray, "frame frame"]:
    """Projects a piece onto what no parabola describes."""
    basis, _ = np.linalg.qr(np.vander(np.linspace(-1, 1, PIECE_FRAMES), DEGREE + 1))
    return np.eye(PIECE_FRAMES) - basis @ basis.T

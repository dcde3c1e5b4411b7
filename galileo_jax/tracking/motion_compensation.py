"""How motion compensation shifts what a video shows, and the places without it.

A coder predicts a moving block from the frame before it, shifted by a whole number of half pixels
(MPEG-4) or quarter pixels (H.264, H.265), and codes of the rest only what is large. So the picture
is drawn towards the nearest such step: an object whose displacement from frame to frame is d is
seen off its place by

    e = sum_k a_k sin(2 pi k d)      k = 1: whole pixels, k = 2: half pixels, k = 4: quarter pixels

and not at all in frames that are coded whole. How strongly depends on coder and bit rate, and a
little on what is on the object and which way it moves: each object has amplitudes of its own along
each axis of the image, about those of the video. They are found in the video itself, where objects
move smoothly: the largest likelihood of

    x_t = path_t + e(x_t - x_(t-1)) + noise

in short pieces, less a parabola each. Its Jacobian, 1 - e'(x_t - x_(t-1)), keeps noise in x_t,
which is in the displacement as well, from being taken for e.

Source: G. Sullivan, T. Wiegand, "Rate-Distortion Optimization for Video Compression", IEEE Signal
Processing Magazine 15 (1998) 74, doi:10.1109/79.733497 (motion-compensated prediction). The sine is
what was measured: docs/explanation/tracking.md.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import minimize

from galileo_jax.numerics.runs import stretches
from galileo_jax.tracking.noise import has_moved

STEPS_PER_PX = np.array([1.0, 2.0, 4.0])
USUAL_PX = np.array([0.006, 0.03, 0.03])
"""Prior sds of a video's amplitudes: rendered MPEG-4 had -0.006 px (whole pixels) and -0.03 px
(half pixels), H.264 and H.265 -0.02 px (quarter pixels)."""
OWN_PX = np.array([0.003, 0.01, 0.004])
"""Sds of an object's own about those (half pixels: -0.026, -0.023, -0.033 px; 60 rendered
clips)."""
OWN_NOISE_VALUES = 5.0  # that an object's noise weighs against with the noise of the whole video
PIECE_FRAMES, DEGREE = 8, 2
MIN_PIECES = 3  # fewer pieces tell no amplitude
ROUGH = 6.0  # a piece with so many times the usual mean square is left out: something was hit in it
MOST_ALIKE = 0.8
"""If displacements agree so well in where they lie between two half pixels (length of the mean
phasor), a piece tells nothing."""
SLOPE_MOST = 0.9  # of e': beyond 1, two places of the object would give the same picture
VARIES_PX, VARIES_SHARE = 0.005, 0.3
"""By how much an amplitude differs from what was found, now more, now less, for `LASTS_FRAMES`: sd,
at most this share of the amplitude (more probable by 54 nats in 120 rendered clips)."""
LASTS_FRAMES = 10.0
LEAST_VOLUME = 1e-3
SHARE_LEFT = 1 - (DEGREE + 1) / PIECE_FRAMES  # of a piece's values, what a parabola leaves
FASTEST_PX = 32.0
"""From a frame to the next: amplitudes were -0.027 px up to 16 px, -0.02 px to 32 px and 0 beyond
(60 rendered clips); so far a coder finds no block again."""
TURNS_RAD = 0.01  # from a frame to the next: a third of a pixel at the rim of a middling object


@dataclass(frozen=True)
class Coding:
    """How the frames that are tracked were coded."""

    # `[frame]`, which frames a coder has predicted from the frame before them
    is_predicted: Bool[np.ndarray, " frame"]
    # pixels of the frames that are tracked, `[*, 2]`, to those that were coded
    to_coded: Callable[[np.ndarray], np.ndarray] = np.asarray
    from_coded: Callable[[np.ndarray], np.ndarray] = np.asarray  # the way back


class Mended(NamedTuple):
    """An object's poses without what motion compensation shifts them."""

    # `[frame, 3]`, x and y in px, angle in rad; NaN where not visible
    poses: Float[np.ndarray, "frame 3"]
    # `[frame, pattern, 2]`, what is uncertain in it; see `tracking.track.Track`
    shifts_px: Float[np.ndarray, "frame pattern 2"]


def without_coding_shift(
    paths: Sequence[tuple[Float[np.ndarray, "frame 3"], Float[np.ndarray, "frame 2 2"]]],
    coding: Coding,
    clock: Float[np.ndarray, " frame"],
) -> list[Mended]:
    """The poses of all objects without what motion compensation shifts them.

    `paths` has per object the poses as the frames show them (x and y in px, angle in rad) and the
    covariance of image noise, px^2, NaN where not visible; `clock` when each frame was taken, in
    usual steps.
    """
    shown = [(coding.to_coded(poses[:, :2]), covariance) for poses, covariance in paths]
    amplitudes_px = coding_shift_amplitudes_px(shown, coding.is_predicted, clock)
    found = []
    for (poses, _), (coded, covariance), own_px in zip(paths, shown, amplitudes_px, strict=True):
        # what does not move is shown where it was, and noise in its steps would only add noise.
        # what turns no shifted block predicts, so that it is coded anew.
        is_turning = np.abs(np.diff(poses[:, 2:], axis=0, prepend=np.nan)) > TURNS_RAD
        is_coded = _moves(coded, covariance) & ~is_turning
        sines = np.where(is_coded[..., None], _sines(coded, coding.is_predicted)[0], 0.0)
        shift = np.sum(sines * own_px, axis=-1)
        is_shifted = shift.any(axis=1, keepdims=True)
        place = np.where(is_shifted, coding.from_coded(coded - shift), poses[:, :2])
        sizes = sines * np.minimum(VARIES_PX, VARIES_SHARE * np.abs(own_px))
        # a vector for each step and axis: along x those of x, along y those of y.
        uncertain = sizes.transpose(0, 2, 1)[..., None] * np.eye(2)
        uncertain = uncertain.reshape(len(poses), 2 * len(STEPS_PER_PX), 2)
        away = coding.from_coded(coded[:, None] + uncertain) - coding.from_coded(coded[:, None])
        found.append(Mended(np.column_stack([place, poses[:, 2]]), away))
    return found


def coding_shift_amplitudes_px(
    paths: Sequence[tuple[Float[np.ndarray, "frame 2"], Float[np.ndarray, "frame 2 2"]]],
    is_predicted: Bool[np.ndarray, " frame"],
    clock: Float[np.ndarray, " frame"],
) -> Float[np.ndarray, "object 2 step"]:
    """The amplitudes a_k, px, of each object along each axis, for each of `STEPS_PER_PX`.

    0 where too little moves in the video to tell; the video's where too little of the object does.
    """
    found = np.zeros((len(paths), 2, len(STEPS_PER_PX)))
    pieces = [
        (piece, (index, axis))
        for index, (place, covariance) in enumerate(paths)
        for axis in range(2)
        for piece in _smooth_pieces(place, covariance, is_predicted, clock, axis)
    ]
    if len(pieces) < MIN_PIECES:
        return found
    size = np.array([np.mean(piece.left**2) for piece, _ in pieces])
    pieces = [pieces[i] for i in np.flatnonzero(size < ROUGH * np.median(size))]
    whole = _together([piece for piece, _ in pieces])
    found[:] = usual = _likeliest(whole, np.zeros(len(STEPS_PER_PX)), USUAL_PX, 0.0)
    noise2 = float(np.sum(whole.errors(usual) ** 2)) / whole.degrees
    for whose in sorted({whose for _, whose in pieces}):
        own = _together([piece for piece, each in pieces if each == whose])
        found[whose] = _likeliest(own, usual, OWN_PX, noise2)
    return found


class _Smooth(NamedTuple):
    """Pieces of smooth motion, less a parabola each."""

    left: np.ndarray  # `[..., frame]`, px, what a parabola leaves of the places
    pattern: np.ndarray  # `[..., frame, step]`, what it leaves of the sines
    slope: np.ndarray  # `[..., frame, step]`, the sines' derivatives by the displacement, 1/px

    @property
    def degrees(self) -> float:
        """How many values a parabola in each piece leaves free."""
        return SHARE_LEFT * self.left.size

    def errors(self, amplitudes_px: Float[np.ndarray, " step"]) -> np.ndarray:
        """What is left without the shifts, `[..., frame]`, px."""
        return self.left - self.pattern @ amplitudes_px


def _together(pieces: Sequence[_Smooth]) -> _Smooth:
    return _Smooth(*(np.stack(each) for each in zip(*pieces, strict=True)))


def _smooth_pieces(
    place: Float[np.ndarray, "frame 2"],
    covariance: Float[np.ndarray, "frame 2 2"],
    is_predicted: Bool[np.ndarray, " frame"],
    clock: Float[np.ndarray, " frame"],
    axis: int,
) -> Iterator[_Smooth]:
    """Pieces of an object's motion along an axis, one after the other, that tell amplitudes."""
    pattern, slope = (each[:, axis] for each in _sines(place, is_predicted))
    step = np.diff(place[:, axis], prepend=np.nan)
    for run in stretches(_moves(place, covariance)[:, axis]):
        for first in range(run.start, run.stop - PIECE_FRAMES + 1, PIECE_FRAMES):
            own = slice(first, first + PIECE_FRAMES)
            if np.abs(np.mean(np.exp(2j * np.pi * STEPS_PER_PX[0] * step[own]))) >= MOST_ALIKE:
                continue
            # Projects a piece onto what no parabola describes.
            since = 2 * (clock[own] - clock[first]) / (clock[own][-1] - clock[first]) - 1
            basis, _ = np.linalg.qr(np.vander(since, DEGREE + 1))
            off_path = np.eye(PIECE_FRAMES) - basis @ basis.T
            yield _Smooth(off_path @ place[own, axis], off_path @ pattern[own], slope[own])


def _likeliest(
    pieces: _Smooth,
    usual_px: Float[np.ndarray, " step"],
    sd_px: Float[np.ndarray, " step"],
    usual_noise2: float,
) -> Float[np.ndarray, " step"]:
    """The most probable amplitudes, px, of pieces `[piece, frame]`, whatever the noise's size.

    The prior is `usual_px` +- `sd_px`. `usual_noise2`, px^2, weighs as `OWN_NOISE_VALUES` values;
    0: nothing is known of the noise.
    """
    beside = OWN_NOISE_VALUES if usual_noise2 else 0.0
    degrees = pieces.degrees + beside

    def cost(amplitudes: np.ndarray) -> tuple[float, np.ndarray]:
        errors, away = pieces.errors(amplitudes), (amplitudes - usual_px) / sd_px
        square = np.sum(errors**2) + beside * usual_noise2 + 1e-12
        volume = 1 - pieces.slope @ amplitudes
        is_open = volume > LEAST_VOLUME
        volume = np.maximum(volume, LEAST_VOLUME)
        value = degrees / 2 * np.log(square) - SHARE_LEFT * np.sum(np.log(volume))
        gradient = -degrees / square * np.einsum("pfk,pf->k", pieces.pattern, errors)
        gradient += SHARE_LEFT * np.einsum("pfk,pf->k", pieces.slope, is_open / volume)
        return float(value + np.sum(away**2) / 2), gradient + away / sd_px

    most = SLOPE_MOST / (2 * np.pi * STEPS_PER_PX)
    bounds = list(zip(-most, most, strict=True))
    ends = [
        minimize(cost, np.clip(start, -most, most), jac=True, bounds=bounds)
        for start in (usual_px, usual_px - sd_px / STEPS_PER_PX)
    ]
    return np.asarray(min(ends, key=lambda end: float(end.fun)).x)


def _sines(
    place: Float[np.ndarray, "frame 2"], is_predicted: Bool[np.ndarray, " frame"]
) -> tuple[Float[np.ndarray, "frame 2 step"], Float[np.ndarray, "frame 2 step"]]:
    """The sines of the displacement, and their derivatives by it, 1/px.

    0 where a coder has not predicted the object from the frame before: where that is coded whole,
    it is not visible, or too fast.
    """
    step, rate = np.diff(place, axis=0, prepend=np.nan), 2 * np.pi * STEPS_PER_PX
    is_found = is_predicted[: len(step)] & (np.hypot(*step.T) < FASTEST_PX)  # not of NaN
    phase = rate * np.where(is_found[:, None], step, 0.0)[..., None]
    return np.sin(phase), np.where(is_found[:, None, None], rate * np.cos(phase), 0.0)


def _moves(
    place: Float[np.ndarray, "frame 2"], covariance: Float[np.ndarray, "frame 2 2"]
) -> Bool[np.ndarray, "frame 2"]:
    """Whether the step into a frame is beyond noise."""
    steps = has_moved(place, covariance)
    return np.pad(steps, ((len(place) - len(steps), 0), (0, 0)))

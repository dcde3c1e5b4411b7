"""The honest error of a tracked point: what image noise alone does not explain."""

from collections.abc import Sequence

import numpy as np

MOVED_SDS = 4.0  # a step of more standard deviations than these is a motion, not noise
MIN_WINDOWS = 8  # fewer third differences do not tell a variance
THIRD_FRAMES = 4  # frames of a third difference
CHI2_MEDIAN = 0.4549  # median of chi^2 with one degree of freedom
CUT_SDS, CUT_VARIANCE = 3.0, 0.9733
"""Differences beyond are blows; the variance that a normal keeps there."""
SAMPLING_SD_PX = 0.002
"""The alignment's own error, per axis, that sampling a texture with pixels makes: 0.0008 px from
place to place, 0.0019 px where boxes also turn (drawn without noise). It is counted at rest,
too."""
MEMORY_FRAMES = 3  # at rest noise correlates by 0.45, 0.2, 0.1 at lags of 1, 2, 3 frames (MPEG-4)
POOLED_FRAMES = 10.0
"""What all objects of a video have together counts as so many frames of each: with 10 the log mean
square of errors over stated ones differed least between stretches (by 0.27; 60 rendered clips)."""
OVERLAP = 2.3
"""Third differences share frames: so many tell as much of a variance as one (sum of their squared
correlations, 1 + 2 (0.75^2 + 0.3^2 + 0.05^2))."""
FAST_PX = 40.0
"""From a frame to the next: at this speed a smeared picture has twice the variance of a slow one.
Else squared errors over stated ones were 1.3 from 16 to 32 px, 1.6 beyond (120 rendered clips)."""
SETTLES_FRAMES = 5
"""What has come to rest a coder leaves off its place for so many frames more: squared errors were 2
to 3 times those stated at rest (60 rendered clips; lossless ones: none)."""
SLOW_PX, SLOW_SCALE2 = 0.1, 3.0
"""Per frame: what moves more slowly, and in the frame after the last step, a coder leaves where it
was; squared errors were 3 times those of faster motion (120 rendered clips)."""
SUDDEN_PX = 1.0  # what a blow moves by a frame; less may be the slow beginning of a slide
GROWS = 1.25  # steps of a slide from rest are as 1 : 3 : 5; those after a blow stay or decrease
AFTER_BLOW_SCALE2 = (4.0, 2.0)
"""In the first two frames of a motion that a blow began: rms 0.026 and 0.018 for later 0.013 px in
60 rendered clips, 0.013 and 0.009 for 0.006 px in 12 lossless ones."""
STEADY_FRAMES = 9  # the median of so many accelerations is not touched by two blows
BLOW_KNOWN_TO = 0.5
"""Share of a blow's shift that stays unknown: a turn over an edge takes its time, and the open
share of the exposure is known to some 15 %."""


def has_moved(place: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Whether each step, `[frame - 1, ...]`, is beyond noise; a step from or to NaN is not.

    Args:
      place: `[frame, ...]`, px.
      noise: its variance, the same shape, px^2; or the covariance of each of `[frame, 2]`.
    """
    variance = noise if noise.ndim == place.ndim else np.einsum("fii->fi", noise)
    return np.diff(place, axis=0) ** 2 > MOVED_SDS**2 * (variance[1:] + variance[:-1])


def covariance_in_motion(
    place: np.ndarray, noise: np.ndarray, excess: np.ndarray, clock: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """`[frame, 2, 2]`, px^2: what is to be stated of a track, and where it moves, `[seen, 2]`.

    Args:
      place: `[frame, 2]`, px; NaN where not visible.
      noise: `[frame, 2, 2]`, px^2, of the image alone.
      excess: `[2]`, px^2, of what moves in this video, slowly: see `motion_variance`.
      clock: `[frame]`, when each was taken, in usual steps.
    """
    covariance, frames = noise.copy(), np.flatnonzero(np.isfinite(place[:, 0]))
    seen = place[frames], noise[frames]
    moves = is_in_motion(*seen)
    covariance[frames] += (moves * excess * speed_scale2(seen[0])[:, None])[..., None] * np.eye(2)
    scale2 = motion_scale2(place, covariance, clock) * after_blow_scale2(*seen) * slow_scale2(*seen)
    scale = np.sqrt(np.where(moves, scale2, 1.0))
    covariance[frames] *= scale[:, :, None] * scale[:, None, :]
    return covariance, moves


def is_in_motion(place: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """`[frame, 2]`, per image axis: whether what is tracked moves there, or did just before.

    A frame counts if the step into it, out of it, or into one of the `SETTLES_FRAMES` before is
    beyond noise: a coder holds back the beginning of a motion, and is late at its end. `place`
    `[frame, 2]`, px, is finite; `covariance` `[frame, 2, 2]` is that of image noise.
    """
    moved = has_moved(place, covariance)
    out_of = np.pad(moved, ((0, 1), (0, 0)))
    before = np.pad(moved, ((SETTLES_FRAMES + 1, 0), (0, 0)))
    return out_of | _windows(before, SETTLES_FRAMES + 1).any(axis=-1)


def after_blow_scale2(place: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """`[frame, 2]`: by what the variance of motion grows where a blow begins it."""
    moved = has_moved(place, covariance)
    # Into the frame that a step leaves; what moves in its first frame may have moved before.
    stood = ~np.pad(moved, ((1, 0), (0, 0)), constant_values=True)[:-1]
    step = np.pad(np.abs(np.diff(place, axis=0)), ((0, 2), (0, 0)))
    largest = np.maximum(step[:-2], step[1:-1])
    is_blow = moved & stood & (largest > SUDDEN_PX) & (step[2:] < GROWS * largest)
    scale2 = np.ones(place.shape)
    for frame, axis in np.argwhere(is_blow):
        after = scale2[frame + 1 :, axis]
        after[: len(AFTER_BLOW_SCALE2)] = AFTER_BLOW_SCALE2[: len(after)]
    return scale2


def slow_scale2(place: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """`[frame, 2]`: by what the variance of motion grows along an axis where hardly anything moves.

    What has come to rest is not in motion: from the second frame after its last step on it has the
    usual variance.
    """
    moved = np.pad(has_moved(place, covariance), ((2, 0), (0, 0)))
    step = np.abs(np.diff(place, axis=0, prepend=place[:1]))
    return np.where((step < SLOW_PX) & (moved[1:] | moved[:-1]), SLOW_SCALE2, 1.0)


def speed_scale2(place: np.ndarray) -> np.ndarray:
    """`[frame]`: by what slow motion's scatter grows with the speed; 1 where not visible."""
    step = np.hypot(*np.diff(place, axis=0, prepend=place[:1]).T)
    return 1.0 + (np.nan_to_num(step) / FAST_PX) ** 2


def motion_variance(
    paths: Sequence[tuple[np.ndarray, np.ndarray]], clock: np.ndarray
) -> np.ndarray:
    """`[2]`, px^2: variance per image axis beyond the stated noise while moving along it, slowly.

    A coder predicts what moves from the frame before, shifted by half or quarter pixels, and
    codes of the rest only what is large: the picture is drawn towards its predictions. So are
    alignments; along the motion and at any speed (0.02 px in MPEG-4, five times the noise). All
    objects of a video share the coder: what they scatter is pooled. Third differences remove smooth
    motion; those beyond three standard deviations are blows and left out. 0 where too few are left.

    `paths` has per object `place` `[frame, 2]` and `covariance` `[frame, 2, 2]` of image noise, NaN
    where not visible; `clock` when each frame was taken, in usual steps.
    """
    excess = np.zeros(2)
    for axis in range(2):
        differences = [
            _third_differences(p[:, axis], c[:, axis, axis], clock, speed_scale2(p))
            for p, c in paths
        ]
        square, stated, scale2 = np.concatenate(differences, axis=1)
        if len(square) >= MIN_WINDOWS:
            # In units of the slow motion's.
            excess[axis] = _excess(square / scale2, stated / scale2)
    return excess


def motion_scale2(place: np.ndarray, covariance: np.ndarray, clock: np.ndarray) -> np.ndarray:
    """`[2]`: by how much one object's variance in motion differs from what is stated, per axis.

    The excess is pooled over all objects, and image noise is overstated where a picture is smeared;
    an object's own third differences tell what it is. They weigh against `POOLED_FRAMES` frames
    that are as stated. `covariance` is with the excess in motion.
    """
    scale2 = np.ones(2)
    for axis in range(2):
        square, stated, _ = _third_differences(place[:, axis], covariance[:, axis, axis], clock)
        if len(square) >= MIN_WINDOWS:
            ratio = square / stated
            own = _excess(ratio, np.full_like(ratio, 1e-12))  # of nothing stated: all there is
            count = np.sum(ratio <= CUT_SDS**2 * own) / OVERLAP
            scale2[axis] = (POOLED_FRAMES + count * own) / (POOLED_FRAMES + count)
    return scale2


def _third_differences(
    place: np.ndarray, variance: np.ndarray, clock: np.ndarray, excess: np.ndarray | None = None
) -> np.ndarray:
    """`[3, window]`: squared third differences of `[frame]` while moving, and their variances.

    Of unevenly spaced frames the divided difference, 3! sum_i x_i / prod_(j != i) (t_i - t_j),
    which removes parabolas all the same. The second row has what the stated `variance` makes of it,
    the third what another error, `excess`, does.
    """
    if len(place) < THIRD_FRAMES:
        return np.empty((3, 0))
    moves = _windows(has_moved(place, variance), THIRD_FRAMES - 1).all(axis=1)
    at = _windows(clock, THIRD_FRAMES)
    apart = at[:, :, None] - at[:, None, :] + np.eye(THIRD_FRAMES)
    share = 6 / apart.prod(axis=2)
    third = np.sum(_windows(place, THIRD_FRAMES) * share, axis=-1)
    both = (variance, np.zeros_like(variance) if excess is None else excess)
    expected = [np.sum(_windows(each, THIRD_FRAMES) * share**2, axis=-1) for each in both]
    return np.stack([third**2, *expected])[:, moves]


def _excess(square: np.ndarray, stated: np.ndarray) -> float:
    """The variance that normal values with these squares have beyond the `stated`, >= 0.

    Maximum likelihood, by scoring, without the values beyond `CUT_SDS`.
    """
    excess = float(np.median(square)) / CHI2_MEDIAN
    for _ in range(30):
        variance = stated + excess
        weight = (square <= CUT_SDS**2 * variance) / variance**2
        surplus = square / CUT_VARIANCE - stated
        excess = max(0.0, float((weight * surplus).sum() / max(weight.sum(), 1e-300)))
    return excess


def blow_shift(jumps: np.ndarray, exposure_share: float) -> np.ndarray:
    """`[frame, 2]`, px: how far blows within an exposure shift what its picture shows.

    A picture shows the mean place during the exposure e. If the velocity jumps by dv at a time
    t from its middle, that is off the place at its middle by

        dv (e / 2 - |t|)^2 / 2 e     for |t| < e / 2, else 0.

    When the blow fell is told by how the jump is shared with the frame beside: a share
    |t| / frame of dv shows there. Only what exceeds the steady acceleration around it is a blow.

    Limits: the shift is in the measured `jumps` (`[frame, 2]`, px per frame), too, so that it comes
    out up to a half too small for a picture's mean place. An alignment prefers the sharper of the
    two motions in it, and over 40 rendered blows the shifts were as small: see `BLOW_KNOWN_TO`.
    """
    if not exposure_share:
        return np.zeros_like(jumps)
    blow = np.pad(sudden(jumps), ((1, 1), (0, 0)))
    own = np.linalg.norm(blow[1:-1], axis=1)
    direction = blow[1:-1] / np.maximum(own, 1e-12)[:, None]
    before, after = ((side * direction).sum(axis=1) for side in (blow[:-2], blow[2:]))
    beside = np.maximum(np.maximum(before, after), 0)
    whole = own + beside
    instant = beside / np.maximum(whole, 1e-12)
    open_after = np.maximum(exposure_share / 2 - instant, 0)
    return (whole * open_after**2 / (2 * exposure_share))[:, None] * direction


def sudden(jumps: np.ndarray) -> np.ndarray:
    """`[frame, 2]`: what changes of the velocity exceed the steady acceleration around them by."""
    padded = np.pad(jumps, ((STEADY_FRAMES // 2,) * 2, (0, 0)), mode="edge")
    return jumps - np.median(_windows(padded, STEADY_FRAMES), axis=-1)


def _windows(values: np.ndarray, frames: int) -> np.ndarray:
    """So many frames in a row, as the last axis."""
    return np.lib.stride_tricks.sliding_window_view(values, frames, axis=0)

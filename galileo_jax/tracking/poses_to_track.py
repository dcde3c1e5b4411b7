"""Converts fitted poses to a track: visibility, the followed point's position and uncertainty."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from galileo_jax.clip.declaration import CLICK_SD_PX
from galileo_jax.numerics.runs import stretches
from galileo_jax.tracking.fragments import Piece
from galileo_jax.tracking.motion_compensation import Coding, without_coding_shift
from galileo_jax.tracking.noise import (
    BLOW_KNOWN_TO,
    MEMORY_FRAMES,
    SAMPLING_SD_PX,
    blow_shift,
    covariance_in_motion,
    motion_variance,
)
from galileo_jax.tracking.pose import length, rotation
from galileo_jax.tracking.refiner import Refined

MIN_CORRELATION = 0.7
MAX_COVERED, MAX_OUTSIDE = 0.25, 0.1
"""An object is visible if its patch correlates with the template, no more of it than these
shares differs from the template by more than noise, or lies beyond the picture's border."""
LONG_RUN = 10  # of frames is believed after any gap
SAME_PLACE_PX = 1.0  # what comes back this close to where it was had only been covered
LONG_GAP, PATH_FRAMES = 4.0, 8
"""After so many usual steps out of sight the path of so many frames before has to lead to where an
object is seen again."""
LEAST_WAY_PX, OFF_WAY = 10.0, 0.5
"""If it would have gone so far meanwhile, it may be off by this share of that."""


@dataclass(frozen=True)
class Finished:
    """One object's part of a track; fields as in `Track`, without the object's axis."""

    position_px: np.ndarray
    covariance_px2: np.ndarray
    common_px2: np.ndarray
    shifts_px: np.ndarray
    angle_rad: np.ndarray


def finished(
    fits: Sequence[list[Refined | None]],
    pieces: Sequence[Piece],
    shares: Sequence[float],
    coding: Coding,
    clock: np.ndarray,
    is_alone: bool = True,
) -> list[Finished]:
    """The pieces' tracks from their fits of every frame (None: not found).

    `shares` are open shares of a frame's time; `clock` `[frame]` is in usual steps. One object
    alone (`is_alone`) no other can hit while it is hidden.
    """
    seen = [
        _seen(found, piece.corrected, clock if is_alone else None)
        for found, piece in zip(fits, pieces, strict=True)
    ]
    # A coder sees what is shown, before anything else is put right.
    mended = without_coding_shift(seen, coding, clock)
    seen = [
        _at_mid_exposure(one.poses, noise, share, piece, clock)
        for one, (_, noise), piece, share in zip(mended, seen, pieces, shares, strict=True)
    ]
    excess = motion_variance([(poses[:, :2], noise) for poses, noise in seen], clock)
    return [
        _anchored(poses, noise, one.shifts_px, found, piece, excess, clock)
        for (poses, noise), one, found, piece in zip(seen, mended, fits, pieces, strict=True)
    ]


def joined(pieces: Sequence[Finished], count: int) -> Finished:
    """One object's pieces, which follow each other, as one track of so many frames."""
    whole = Finished(**{
        name: np.full((count, *values.shape[1:]), np.nan)
        for name, values in vars(pieces[0]).items()
    })  # fmt: skip
    for piece in pieces:
        is_seen = np.isfinite(piece.angle_rad)
        for name, values in vars(piece).items():
            getattr(whole, name)[is_seen] = values[is_seen]
    if len(pieces) > 1:
        whole.common_px2[:] *= 0.0  # each piece has its own
    return whole


def _seen(
    fits: list[Refined | None], corrected: Sequence[int], clock: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    """Poses `[frame, 3]` and their image noise `[frame, 2, 2]`; NaN: not visible."""
    poses = np.full((len(fits), 3), np.nan)
    noise = np.full((len(fits), 2, 2), np.nan)
    for index, fit in enumerate(fits):
        if fit is not None and _is_visible(fit):
            poses[index], noise[index] = fit.pose, fit.covariance
    is_doubtful = ~_without_glimpses(poses, corrected)
    if clock is not None:
        believed = np.where(is_doubtful[:, None], np.nan, poses)
        is_doubtful[_led_to(believed, corrected, clock) :] = True
    poses[is_doubtful], noise[is_doubtful] = np.nan, np.nan
    return poses, noise


def _at_mid_exposure(
    poses: np.ndarray, noise: np.ndarray, exposure_share: float, piece: Piece, clock: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The poses without what blows within an exposure shift them, and the noise with the rest."""
    jumps = np.zeros((len(poses), 2))
    for index in np.flatnonzero(np.isfinite(poses[:, 0])):
        jumps[index] = piece.velocities(poses, int(index), clock).jump[:2]
    shift = blow_shift(jumps, exposure_share)
    unknown = BLOW_KNOWN_TO**2 * (shift**2).sum(axis=1)
    corrected = poses - np.pad(shift, ((0, 0), (0, 1)))
    return corrected, noise + unknown[:, None, None] * np.eye(2)


def _anchored(
    poses: np.ndarray,
    noise: np.ndarray,
    shifts_px: np.ndarray,
    fits: list[Refined | None],
    piece: Piece,
    excess: np.ndarray,
    clock: np.ndarray,
) -> Finished:
    """The followed point's places: rigid with the poses, `point_px` where the object began.

    Where it began is the mean of the frames before it moves, so that the noise of its first
    frame is not in every point.
    """
    covariance, moves = covariance_in_motion(poses[:, :2], noise, excess, clock)
    frames = np.flatnonzero(np.isfinite(poses[:, 0]))
    first_frame, point_px = piece.first_frame, np.array(piece.point_px)
    first_fit = fits[first_frame] if first_frame < len(fits) else None
    anchor = np.array([*point_px, 0.0])
    common = np.zeros_like(covariance)
    if first_fit is not None:
        anchor, anchor_noise = first_fit.pose, first_fit.covariance
        at_rest = frames[np.cumprod(~moves.any(axis=1)).astype(bool)] if len(frames) else frames
        is_unbroken = at_rest == first_frame + np.arange(len(at_rest))
        began = at_rest[is_unbroken]
        if len(began):
            anchor = poses[began].mean(axis=0)
            anchor_noise = noise[began].mean(axis=0) / max(1.0, len(began) / MEMORY_FRAMES)
        common = np.broadcast_to(anchor_noise, covariance.shape)
        covariance += common
    covariance += SAMPLING_SD_PX**2 * np.eye(2)
    if piece.is_clicked:
        covariance += CLICK_SD_PX**2 * np.eye(2)

    angle = poses[:, 2] - anchor[2]
    arm = point_px - anchor[:2]
    position = poses[:, :2] + np.stack([rotation(a) @ arm for a in angle])
    return Finished(position, covariance, common, shifts_px, angle + piece.turned_rad)


def _without_glimpses(poses: np.ndarray, corrected: Sequence[int]) -> np.ndarray:
    """`[frame]`: where `poses` `[frame, 3]` are to be believed.

    What comes back for a few frames after a longer absence is more likely something like it,
    unless it is where it was, or somebody has seen it there.
    """
    result, last_end = np.zeros(len(poses), bool), 0
    for run in stretches(np.isfinite(poses[:, 0])):
        count, gap = run.stop - run.start, run.start - last_end
        is_corrected = any(run.start <= frame < run.stop for frame in corrected)
        is_same = length(poses[run.start] - poses[last_end - 1]) < SAME_PLACE_PX
        if not last_end or is_same or is_corrected or count >= min(gap, LONG_RUN):
            result[run], last_end = True, run.stop
    return result


def _led_to(poses: np.ndarray, corrected: Sequence[int], clock: np.ndarray) -> int:
    """The first frame after a gap to which the path before it does not lead; or how many there are.

    Something has happened to the object while it was out of sight, or it is another one: what
    follows is another motion. What would hardly have moved, or has been seen by somebody, counts.
    """
    known = np.flatnonzero(np.isfinite(poses[:, 0]))
    for last, back in itertools.pairwise(known):
        own = known[(known <= last) & (known > last - PATH_FRAMES)]
        gap = clock[back] - clock[last]
        if gap < LONG_GAP or len(own) < PATH_FRAMES // 2 or any(at > last for at in corrected):
            continue
        since = clock[own] - clock[back]
        line, parabola = (np.polyfit(since, poses[own, :2], degree) for degree in (1, 2))
        way = gap * length(line[0])
        off = min(length(poses[back, :2] - end) for end in (line[-1], parabola[-1]))
        if way > LEAST_WAY_PX and off > OFF_WAY * way:
            return int(back)
    return len(poses)


def _is_visible(fit: Refined) -> bool:
    is_shown = fit.covered <= MAX_COVERED and fit.outside <= MAX_OUTSIDE
    return is_shown and fit.correlation >= MIN_CORRELATION

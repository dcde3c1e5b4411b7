"""States the noise of objects at rest by their own scatter.

Sampling and coding shift what moves from frame to frame; what stands still they shift once. The
tracker states both alike, so that a fit of one noise scale would take the quiet frames for a reason
to trust the moving ones too much. The one shift of what has come to rest is stated as a pattern
that all frames of the rest share: however many there are, they do not average it out. Errors that
follow each other within a rest (`errors_at_rest`) are stated as patterns of that rest.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import chdtri

from galileo_jax.measurement.errors_at_rest import errors_at_rest
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.random_patterns import random_patterns
from galileo_jax.tracking.noise import SETTLES_FRAMES

WINDOW = 9  # frames
STILL_SDS = 5.0  # of the stated noise: whoever goes no further in a window is at rest in it
MIN_WINDOWS = 20  # fewer do not tell a variance
LEAST_SCALE = 0.3  # a coder repeats what stands still: less scatter than that is no less noise
# Of a rest's frames beside a motion so many may hold its slow end: errors are not learnt from them.
BESIDE = WINDOW // 2
# What slows down to a stop goes as far in its last frames as noise does, and a coder that leaves a
# picture as it is shows it where it was: errors were 3 times, once 15 times, those of a rest.
SETTLES = WINDOW // 2 + SETTLES_FRAMES
# Of the variance in motion, less what scatters at rest: what has come to rest is coded again, frame
# after frame, until hardly anything is left: 0.16 and 0.34 of it (x, y; object 2 in 120 rendered
# clips that were looked at, MPEG-4), 0.41 and 0.51 (10 in H.264), 0.06 and 0.34 (10 in H.265).
SHIFT_SHARE = 0.4
FAINT = 0.1  # of the independent errors: a weaker pattern of errors is left out


def with_noise_at_rest(observation: Observation) -> Observation:
    """The observation, its covariance lowered where objects are at rest, with the rests' shifts.

    Args:
      observation: of a video that was tracked, with the tracker's stated covariance.
    """
    is_still, squares = np.zeros_like(observation.mask), []
    for i, mask in enumerate(observation.mask):
        if len(mask) < WINDOW:
            return observation
        variance = np.diagonal(observation.covariance_m2[i]).T
        place = _windows(observation.position_m[i])
        white = (place - place.mean(axis=-1, keepdims=True)) / np.sqrt(_windows(variance))
        seen, away = _windows(mask).all(axis=-1), np.abs(white).max(axis=(0, 2))
        still = seen & (np.nan_to_num(away, nan=np.inf) < STILL_SDS)
        is_still[i] = _settled(_covered(still, len(mask)))
        squares.append(np.sum(white[:, still] ** 2, axis=-1).reshape(-1))
    found = np.concatenate(squares)
    if len(found) < MIN_WINDOWS:
        return replace(observation, modes_m=_with_shifts(observation, is_still))
    # The median: a window that holds the begin of a motion does not count.
    share = float(np.median(found) / chdtri(WINDOW - 1, 0.5))
    scale2 = np.where(is_still, np.clip(share, LEAST_SCALE**2, 1.0), 1.0)
    covariance = observation.covariance_m2 * scale2[:, None, None]
    lowered = replace(observation, covariance_m2=covariance)
    return _with_errors(replace(lowered, modes_m=_with_shifts(lowered, is_still)), is_still)


def _with_errors(
    observation: Observation, is_still: Bool[np.ndarray, "object frame"]
) -> Observation:
    """The observation with the covariance of the errors of each rest."""
    covariance, found = observation.covariance_m2.copy(), []
    for i, still in enumerate(is_still):
        for rest in _stretches(still):
            first = BESIDE if rest.start else 0
            after = rest.stop - rest.start - (BESIDE if rest.stop < len(still) else 0)
            if after - first < WINDOW:
                continue
            for axis in range(observation.position_m.shape[1]):
                sd = np.sqrt(observation.covariance_m2[i, axis, axis, rest])
                place = observation.position_m[i, axis, rest]
                alone, together = errors_at_rest(place, sd, first, after)
                root = np.where(np.arange(len(covariance[i])) == axis, np.sqrt(alone), 1.0)
                covariance[i, ..., rest] *= (root[:, None] * root)[..., None]
                least = FAINT * alone / np.linalg.eigvalsh(together)[-1]
                for pattern in random_patterns(together, least):
                    mode = np.zeros_like(observation.position_m)
                    mode[i, axis, rest] = pattern * sd
                    found.append(mode)
    if not found:
        return observation
    before = [] if observation.modes_m is None else list(observation.modes_m)
    modes = np.stack([*before, *found])
    return replace(observation, covariance_m2=covariance, modes_m=modes, num_errors=len(found))


def _with_shifts(
    observation: Observation, is_still: Bool[np.ndarray, "object frame"]
) -> Float[np.ndarray, "mode object 2 frame"] | None:
    """The observation's modes and, of each rest that follows a motion, one along each axis.

    A shift is a share of the errors of the same object while it moves, less what scatters at rest.
    """
    found = [] if observation.modes_m is None else list(observation.modes_m)
    for i, still in enumerate(is_still):
        variance = np.diagonal(observation.covariance_m2[i]).T
        moving = observation.mask[i] & ~still
        if not moving.any():
            continue
        usual = np.median(variance[:, moving], axis=1)
        for rest in _stretches(still):
            if not moving[: rest.start].any():
                continue
            shift2 = SHIFT_SHARE * (usual - np.median(variance[:, rest], axis=1))
            for axis in np.flatnonzero(shift2 > 0):
                mode = np.zeros_like(observation.position_m)
                mode[i, axis, rest] = np.sqrt(shift2[axis])
                found.append(mode)
    return np.stack(found) if found else None


def _stretches(is_there: Bool[np.ndarray, " frame"]) -> list[slice]:
    """Where it is true without a gap."""
    steps = np.diff(np.concatenate([[0], is_there.astype(int), [0]]))
    ends = zip(np.flatnonzero(steps > 0), np.flatnonzero(steps < 0), strict=True)
    return [slice(first, after) for first, after in ends]


def _settled(still: Bool[np.ndarray, " frame"]) -> Bool[np.ndarray, " frame"]:
    """Without the first frames of each rest that follows a motion: there it comes to rest."""
    settled = still.copy()
    for rest in _stretches(still):
        if rest.start:
            settled[rest.start : rest.start + SETTLES] = False
    return settled


def _windows(values: np.ndarray) -> np.ndarray:
    """`[..., frame]` to `[..., window, WINDOW]`."""
    return np.lib.stride_tricks.sliding_window_view(values, WINDOW, axis=-1)


def _covered(windows: Bool[np.ndarray, " window"], frames: int) -> Bool[np.ndarray, " frame"]:
    """Frames that lie in one of these windows."""
    found = np.zeros(frames, bool)
    for shift in range(WINDOW):
        found[shift : shift + len(windows)] |= windows
    return found

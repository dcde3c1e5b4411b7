"""The errors of a track in the picture's plane, of which nobody said how large they are."""

import math
from pathlib import Path

import numpy as np

from galileo_jax.observation.observation import UNMEASURED_SD_M
from galileo_jax.runtime.errors import InputError

MIN_NOISE_WINDOWS = 8
"""Fewer third differences give a standard deviation that is off by a third or more."""

ACROSS = 0.01
"""Who marks a picture is no hundred times better across the motion than along it: then one
coordinate was measured, and both were made of it."""

MIN_SD_M = 1e-5
"""No camera sees less than ten micrometres; also what is taken for positions without noise."""


def position_noise_m(times_s: np.ndarray, position_m: np.ndarray) -> float:
    """The standard deviation of one coordinate's error, estimated from its roughness, m.

    Over every four consecutive visible points the third divided difference
    `sum_j w_j x_j, w_j = 1 / prod_{k != j} (t_j - t_k)` cancels any motion of constant
    acceleration; divided by `sqrt(sum w_j^2)` it is a draw of the error alone. The median of
    its absolute value times 1.4826 is the standard deviation, and is not moved by the few
    points at an impact. Not below `MIN_SD_M`.

    Args:
      times_s: `[frame]`, s, increasing; need not be evenly spaced.
      position_m: `[frame]`, m; NaN where not visible.

    Returns:
      the standard deviation; NaN if fewer than `MIN_NOISE_WINDOWS` windows are visible.

    Limits: assumes errors independent between frames. Motion that changes within three
    frames for most of the clip counts as noise.
    """
    t, x = _whole_windows(times_s, position_m)
    if len(t) < MIN_NOISE_WINDOWS:  # of a track in steps of several rows, no four are consecutive
        seen = np.isfinite(position_m)
        t, x = _whole_windows(times_s[seen], position_m[seen])
    if len(t) < MIN_NOISE_WINDOWS:
        return math.nan
    gaps = t[:, :, None] - t[:, None, :] + np.eye(4)
    weights = 1 / gaps.prod(axis=2)
    draws = (weights * x).sum(axis=1) / np.sqrt((weights**2).sum(axis=1))
    return max(1.4826 * float(np.median(np.abs(draws))), MIN_SD_M)


def _whole_windows(times_s: np.ndarray, position_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions `[window, 4]` of four consecutive points that are all visible."""
    if len(times_s) < 4:
        return np.empty((0, 4)), np.empty((0, 4))
    t = np.lib.stride_tricks.sliding_window_view(times_s, 4)
    x = np.lib.stride_tricks.sliding_window_view(position_m, 4)
    is_whole = np.isfinite(x).all(axis=1)
    return t[is_whole], x[is_whole]


def too_few_rows(path: Path, name: str) -> InputError:
    """What to raise where the rows are too few to tell their error."""
    return InputError(
        f"{path}: column '{name}_sd_m': missing, and too few consecutive rows "
        f"({MIN_NOISE_WINDOWS + 3} expected) to estimate it; give the error in metres"
    )


def roughness_covariance_m2(
    path: Path, name: str, times_s: np.ndarray, position_m: np.ndarray
) -> np.ndarray:
    """Covariance `[2, 2, row]`, m^2, of errors of the same size in every row.

        C = sd_x^2, sd_y^2 on the diagonal, of `position_noise_m`

    Of points on one straight line, nearer to it than `ACROSS` times their error along it, the
    distance from it tells nothing: there it is `UNMEASURED_SD_M`.

    Raises:
      InputError: too few consecutive rows to tell.
    """
    sd = [position_noise_m(times_s, coordinate) for coordinate in position_m]
    if any(map(math.isnan, sd)):
        raise too_few_rows(path, name)
    covariance = np.diag(np.square(sd))
    if len(position_m) == 2 and (line := _line_through(position_m)) is not None:
        along, across = line
        sd_m = position_noise_m(times_s, along @ position_m)
        if np.nanstd(across @ position_m) < ACROSS * sd_m:
            covariance = sd_m**2 * np.outer(along, along)
            covariance += UNMEASURED_SD_M**2 * np.outer(across, across)
    return np.repeat(covariance[:, :, None], len(times_s), axis=2)


def _line_through(position_m: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Unit vectors `[2]` along and across the line nearest to points `[2, row]`; None: at rest."""
    seen = position_m[:, np.isfinite(position_m).all(axis=0)]
    far, vectors = np.linalg.eigh(np.cov(seen))
    return (vectors[:, 1], vectors[:, 0]) if far[1] > MIN_SD_M**2 else None

"""The errors of a track of which nobody said how large they are.

In the picture's plane they are told by differences of neighbours. Several cameras that see a body
in space at slightly different times, or times that are rounded, shift it along its velocity: there
two errors are told, along the velocity u and across it,

    covariance = s^2 (1 - u u^T) + s_along^2 u u^T

each as the scatter about cubics in windows of `WINDOW` rows: a triangulated track wanders over
several rows, so that differences of neighbours would find only a part of it.
"""

import math

import numpy as np

from galileo_jax.numerics.least_squares import polynomial
from galileo_jax.observation.observation import UNMEASURED_SD_M
from galileo_jax.runtime.errors import InputError

MIN_NOISE_WINDOWS = 8
"""The median of fewer third differences is off by a third or more."""

FEWEST_ROWS = 6
"""That tell an error: a parabola leaves three numbers, and their variance has a mean."""

ACROSS = 0.01
"""Who marks a picture is no hundred times better across the motion than along it: then one
coordinate was measured, and both were made of it."""

MIN_SD_M = 1e-5
"""No camera sees less than ten micrometres; also what is taken for positions without noise."""

FEWEST_IN_SPACE = 8
WINDOW, TERMS = 16, 4  # rows; numbers of a cubic
BOUNCES = 9.0  # times the usual variance: no errors scatter so much
HALF_WINDOW = 2  # points on either side, that give the direction of the velocity


def position_noise_m(times_s: np.ndarray, position_m: np.ndarray) -> float:
    """The standard deviation of one coordinate's error, estimated from its roughness, m.

    Over every four consecutive visible points the third divided difference
    `sum_j w_j x_j, w_j = 1 / prod_{k != j} (t_j - t_k)` cancels any motion of constant
    acceleration; divided by `sqrt(sum w_j^2)` it is a draw of the error alone. The median of
    its absolute value times 1.4826 is the standard deviation, and is not moved by the few
    points at an impact. Not below `MIN_SD_M`.

    Of fewer than `MIN_NOISE_WINDOWS` windows it is the root of the variance's mean, after a
    parabola that leaves S of n places (inverse gamma; larger than S / (n - 3), for so few may lie
    near it by chance):

        sd^2 = S / (n - 5)

    Args:
      times_s: `[frame]`, s, increasing; need not be evenly spaced.
      position_m: `[frame]`, m; NaN where not visible.

    Returns:
      the standard deviation; NaN of fewer than `FEWEST_ROWS` places.

    Limits: assumes errors independent between frames. Motion that changes within three
    frames for most of the clip counts as noise.
    """
    t, x = _whole_windows(times_s, position_m)
    if len(t) < MIN_NOISE_WINDOWS:  # of a track in steps of several rows, no four are consecutive
        seen = np.isfinite(position_m)
        t, x = _whole_windows(times_s[seen], position_m[seen])
        if len(t) < MIN_NOISE_WINDOWS:
            return _about_parabola_m(times_s[seen], position_m[seen])
    gaps = t[:, :, None] - t[:, None, :] + np.eye(4)
    weights = 1 / gaps.prod(axis=2)
    draws = (weights * x).sum(axis=1) / np.sqrt((weights**2).sum(axis=1))
    return max(1.4826 * float(np.median(np.abs(draws))), MIN_SD_M)


def _about_parabola_m(times_s: np.ndarray, position_m: np.ndarray) -> float:
    """`position_noise_m` of few places."""
    if (count := len(times_s)) < FEWEST_ROWS:
        return math.nan
    left = polynomial(times_s - times_s[0], position_m, 2).left
    return max(math.sqrt(left @ left / (count - 5)), MIN_SD_M)


def _whole_windows(times_s: np.ndarray, position_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and positions `[window, 4]` of four consecutive points that are all visible."""
    if len(times_s) < 4:
        return np.empty((0, 4)), np.empty((0, 4))
    t = np.lib.stride_tricks.sliding_window_view(times_s, 4)
    x = np.lib.stride_tricks.sliding_window_view(position_m, 4)
    is_whole = np.isfinite(x).all(axis=1)
    return t[is_whole], x[is_whole]


def told_noise_m(name: str, times_s: np.ndarray, position_m: np.ndarray) -> float:
    """`position_noise_m` of an object. Raises `InputError` where too few rows tell it."""
    sd = position_noise_m(times_s, position_m)
    if math.isnan(sd):
        raise _too_few(name, f"too few rows ({FEWEST_ROWS}")
    return sd


def _too_few(name: str, rows: str) -> InputError:
    return InputError(
        f"{name}: {rows} expected) to tell how large its errors are; our own csv may state them, "
        f"in a column {name}_sd_m"
    )


def roughness_covariance_m2(name: str, times_s: np.ndarray, position_m: np.ndarray) -> np.ndarray:
    """Covariance `[2, 2, row]`, m^2, of errors of the same size in every row.

        C = sd_x^2, sd_y^2 on the diagonal, of `position_noise_m`

    Of points on one straight line, nearer to it than `ACROSS` times their error along it, the
    distance from it tells nothing: there it is `UNMEASURED_SD_M`.

    Raises:
      InputError: too few rows to tell.
    """
    sd = [told_noise_m(name, times_s, coordinate) for coordinate in position_m]
    covariance = np.diag(np.square(sd))
    seen = position_m[:, np.isfinite(position_m).all(axis=0)]
    far, vectors = np.linalg.eigh(np.cov(seen))
    if far[1] > MIN_SD_M**2:  # not at rest
        across, along = vectors.T
        sd_m = position_noise_m(times_s, along @ position_m)
        if np.nanstd(across @ position_m) < ACROSS * sd_m:
            covariance = sd_m**2 * np.outer(along, along)
            covariance += UNMEASURED_SD_M**2 * np.outer(across, across)
    return np.repeat(covariance[:, :, None], len(times_s), axis=2)


def space_noise_m(name: str, times_s: np.ndarray, position_m: np.ndarray) -> tuple[float, float]:
    """The standard deviations across and along the velocity, m, of a track `[3, row]`.

    Raises:
      InputError: too few rows to tell.
    """
    seen = np.flatnonzero(np.isfinite(position_m[0]))
    times, places = times_s[seen], position_m[:, seen]
    if len(seen) < FEWEST_IN_SPACE:
        raise _too_few(name, f"too few rows ({FEWEST_IN_SPACE}")
    size = min(WINDOW, len(seen))
    found = []
    for first in range(len(seen) - size + 1):
        part = slice(first, first + size)
        since = (times[part] - times[first]) / (times[first + size - 1] - times[first])
        left = polynomial(since, places[:, part].T, TERMS - 1).left
        way = places[:, first + size - 1] - places[:, first]
        along = left @ (way / max(float(np.linalg.norm(way)), np.finfo(float).tiny))
        free = size - TERMS
        square = float(np.sum(along**2))
        found.append((0.5 * (float(np.sum(left**2)) - square) / free, square / free))
    # Windows with a bounce in them do not count; of others all do, for times are not always as bad.
    variance = np.array(found)
    usual = variance < BOUNCES * np.median(variance, axis=0)
    sd, sd_along = np.sqrt(np.average(variance, axis=0, weights=usual))
    return max(float(sd), MIN_SD_M), max(float(sd_along), float(sd), MIN_SD_M)


def space_covariance_m2(
    times_s: np.ndarray,
    position_m: np.ndarray,
    sd_m: np.ndarray | float,
    along_m: np.ndarray | float,
) -> np.ndarray:
    """`[3, 3, row]`, m^2; NaN where it was not seen."""
    seen = np.flatnonzero(np.isfinite(position_m[0]))
    found = np.full((3, 3, len(times_s)), np.nan)
    places, row = position_m[:, seen], np.arange(len(seen))
    before, after = np.maximum(row - HALF_WINDOW, 0), np.minimum(row + HALF_WINDOW, len(seen) - 1)
    way = places[:, after] - places[:, before]
    way = way / np.maximum(np.linalg.norm(way, axis=0), np.finfo(float).tiny)
    across2, along2 = (np.broadcast_to(np.square(s), len(times_s))[seen] for s in (sd_m, along_m))
    found[:, :, seen] = across2 * np.eye(3)[:, :, None]
    found[:, :, seen] += (along2 - across2) * way[:, None] * way[None]
    return found


def space_sds_m(covariance_m2: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Back from `[3, 3, row]` to the standard deviations across and along, each `[row]`."""
    values = np.full((3, covariance_m2.shape[-1]), np.nan)
    seen = np.isfinite(covariance_m2[0, 0])
    values[:, seen] = np.linalg.eigvalsh(np.moveaxis(covariance_m2[:, :, seen], -1, 0)).T
    return np.sqrt(values[0]), np.sqrt(values[2])

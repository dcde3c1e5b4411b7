"""The errors of a track in space, of which nobody said how large they are.

Several cameras that see a body at slightly different times, or times that are rounded, shift it
along its velocity. So two errors are told from the track's roughness, along the velocity u and
across it:

    covariance = s^2 (1 - u u^T) + s_along^2 u u^T

Each is the scatter about cubics in windows of `WINDOW` rows: a triangulated track wanders over
several rows, so that differences of neighbours, as `plane_noise` takes them of a picture's tracks,
would find only a part of it.
"""

from pathlib import Path

import numpy as np

from galileo_jax.clip.plane_noise import MIN_SD_M
from galileo_jax.runtime.errors import InputError

FEWEST = 8
WINDOW, TERMS = 16, 4  # rows; numbers of a cubic
BOUNCES = 9.0  # times the usual variance: no errors scatter so much
HALF_WINDOW = 2  # points on either side, that give the direction of the velocity


def space_noise_m(
    path: Path, name: str, times_s: np.ndarray, position_m: np.ndarray
) -> tuple[float, float]:
    """The standard deviations across and along the velocity, m.

    Args:
      path: named in the error.
      name: of the object.
      times_s: `[row]`.
      position_m: `[3, row]`, NaN where it was not seen.

    Raises:
      InputError: too few rows to tell.
    """
    seen = np.flatnonzero(np.isfinite(position_m[0]))
    times, places = times_s[seen], position_m[:, seen]
    if len(seen) < FEWEST:
        raise InputError(
            f"{path}: column '{name}_sd_m': missing, and too few rows ({FEWEST} expected) to "
            "estimate it; give the error in metres"
        )
    size = min(WINDOW, len(seen))
    found = []
    for first in range(len(seen) - size + 1):
        part = slice(first, first + size)
        since = (times[part] - times[first]) / (times[first + size - 1] - times[first])
        design = np.vander(since, TERMS)
        left = places[:, part].T - design @ np.linalg.lstsq(design, places[:, part].T)[0]
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
    places = position_m[:, seen]
    last = len(seen) - 1
    before = np.maximum(np.arange(len(seen)) - HALF_WINDOW, 0)
    after = np.minimum(np.arange(len(seen)) + HALF_WINDOW, last)
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

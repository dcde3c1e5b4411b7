"""How far do camera and tracker wander in a clip of pucks seen from above, or of a tossed box?

What they do wanders slowly (an Ornstein-Uhlenbeck process, `similarity.level_discrepancy`), by a
hundredth of a pixel in one clip and by a sixth in another. Slow as it is, it has a fast part that
no sliding puck has, nor a box in free flight: from frame to frame it takes steps of
w sqrt(2 dt / tau). So, before any physics, each coordinate is described in pieces as

    measured = smooth path + wander + error,    w^2 K_tau + s^2 sd^2 1

with a path that is a parabola and a thrice integrated white noise of any size. The
size w is that which explains all pieces of all pucks best, averaged over what explains them well;
s and the path's size are averaged over in each piece.

Limits: between 1/300 of the largest wander, from which on nothing in an interval changes, and the
largest. Where a track is too short to tell, it is taken to be the largest.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from galileo_jax.clip.schema import ClipObject
from galileo_jax.clip.walls import Wall
from galileo_jax.numerics.least_squares import restricted_likelihood
from galileo_jax.numerics.line_segments import nearest_frames
from galileo_jax.observation.observation import Observation

LARGEST_M, LASTS_S = 4e-4, 0.3
"""Standard deviation and duration of the wander in a clip of which nothing is known; the likelihood
takes it so where an observation does not tell."""
IN_SPACE_M, IN_SPACE_S = 2e-3, 0.15  # the same of a track in space
SIZES = np.geomspace(1 / 300, 1.0, 16)  # tried, of the largest
SCALES, SCALE_SD = np.geomspace(0.4, 2.5, 7), 0.5
"""Of the stated errors, and the standard deviation of their logarithm."""
PATHS = np.geomspace(1e-1, 1e7, 13)
"""Sizes of the path's third derivative, in errors over a piece's length^2.5."""
PIECE, LEAST_FRAMES = 40, 8
BESIDE_HIT = 1


def with_wander(
    observation: Observation, objects: Sequence[ClipObject] = (), walls: Sequence[Wall] = ()
) -> Observation:
    """The observation, of pucks or of one body in space, with its wander; walls are in metres."""
    num_axes = len([axis for axis in observation.axes if axis != "turning"])
    largest_m, lasts_s = (LARGEST_M, LASTS_S) if num_axes == 2 else (IN_SPACE_M, IN_SPACE_S)
    sizes_m, evidence = largest_m * SIZES, np.zeros(len(SIZES))
    for i in range(len(observation.names)):
        radius_m = (objects[i].size_m or (0.0,))[0] if walls else 0.0
        place, mask = observation.position_m[i], observation.mask[i]
        bounced = [
            frame
            for wall in walls
            for frame in nearest_frames(place[:2], mask, wall.ends_m, radius_m)
        ]
        for piece, axis in product(_pieces(observation, i, bounced), range(num_axes)):
            if len(piece) >= LEAST_FRAMES:
                variance = observation.covariance_m2[i, axis, axis, piece]
                times_s = observation.times_s[piece]
                evidence += _evidence(times_s, place[axis, piece], variance, sizes_m, lasts_s)
    if not evidence.any():
        return replace(observation, wander_m=largest_m)
    weight = np.exp(evidence - np.asarray(logsumexp(evidence)))
    return replace(observation, wander_m=float(np.sqrt(weight @ sizes_m**2)))


def smooth_path(since: np.ndarray) -> Float[np.ndarray, "row row"]:
    """The covariance of thrice integrated white noise: int_0^s (s-u)^2 (t-u)^2 / 4 du, s <= t.

    Source: Wahba (1978), Improper priors, spline smoothing and the problem of guarding against
    model errors in regression, J. R. Statist. Soc. B 40, 364.
    """
    first = np.minimum(since[:, None], since)
    gap = np.abs(since[:, None] - since)
    return first**5 / 20 + gap * first**4 / 8 + gap**2 * first**3 / 12


def _pieces(observation: Observation, i: int, bounced: Sequence[int]) -> list[np.ndarray]:
    """Frames of puck `i` between hits, in pieces; a hit's own, and those beside it, are in none."""
    frames = np.flatnonzero(observation.mask[i])
    ends = [*bounced]
    for j in range(len(observation.names)):
        apart = observation.apart_m(i, j)
        if j != i and np.isfinite(apart).any():
            ends.append(int(np.argmin(apart)))
    for end in ends:
        frames = frames[np.abs(frames - end) > BESIDE_HIT]
    between = np.split(frames, np.flatnonzero(np.diff(frames) > 2 * BESIDE_HIT) + 1)
    return [
        piece for own in between for piece in np.array_split(own, max(1, round(len(own) / PIECE)))
    ]


def _evidence(
    times_s: Float[np.ndarray, " frame"],
    place_m: Float[np.ndarray, " frame"],
    variance_m2: Float[np.ndarray, " frame"],
    sizes_m: Float[np.ndarray, " size"],
    lasts_s: float,
) -> Float[np.ndarray, " size"]:
    """The log marginal likelihood of a piece for each size, of what no parabola takes up."""
    size = len(times_s)
    since = (times_s - times_s[0]) / (times_s[-1] - times_s[0])
    apart = np.abs(times_s[:, None] - times_s)
    unit = float(np.sqrt(np.median(variance_m2)))
    wander = (sizes_m[:, None, None] / unit) ** 2 * np.exp(-apart / lasts_s)
    error = SCALES[:, None, None] ** 2 * np.diag(variance_m2) / unit**2
    path = PATHS[:, None, None] ** 2 * smooth_path(since)
    cover = wander[:, None, None] + error[:, None] + path  # [size, scale, path, frame, frame]
    determinant, square = restricted_likelihood(cover, np.vander(since, 3), place_m / unit)
    log_density = -(determinant + square) / 2 - (size - 3) * np.log(unit)
    prior = -0.5 * (np.log(SCALES) / SCALE_SD) ** 2
    return np.asarray(logsumexp(log_density + prior[:, None], axis=(1, 2)))

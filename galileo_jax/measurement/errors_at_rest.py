"""The errors of what rests: smaller than in motion, and they follow each other from frame to frame.

Sampling and coding shift what moves from frame to frame, and what stands still once; a coder
repeats what does not change, and with it its error, until it codes it again: then the error is
drawn anew, and may be many times what is stated of a frozen picture. The tracker states one error
for all. Quiet frames, of which most clips have many, would make a fit trust the moving ones too
much, and errors that follow each other look like a small slow motion of a thing that nothing moves.
So each coordinate of each rest is described as

    measured = place + error,    error ~ v sd^2 (.99 K + .01 1),    K = exp(-|frames| / tau),

sd as stated, frames: how far they are apart. K is the covariance of a constant that is drawn anew,
at random, every tau frames; tau = 0: independent errors. The rest is given the covariance that
follows, averaged over tau by the likelihood with the place and v left open, v about what the clip's
rests have on average, as if one window more had shown it. Beside those that last each frame has an
error of LEAST_SCALE of the stated one or more: a picture that a coder froze is no better known.
What has come to rest is besides off by one shift of all its frames: however many there are, they do
not average it out. Of twice as long a rest before all motion, or after it, only `MOST` frames stay.
"""

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri, logsumexp

from galileo_jax.numerics.least_squares import restricted_likelihood
from galileo_jax.numerics.random_patterns import alone, random_patterns
from galileo_jax.numerics.runs import stretches
from galileo_jax.observation.observation import AWAY_M, Observation
from galileo_jax.tracking.noise import SETTLES_FRAMES

WINDOW = 9  # frames
STILL_SDS = 5.0  # of the stated noise: whoever goes no further in a window is at rest in it
BESIDE = WINDOW // 2  # of a rest's last frames so many may hold the slow begin of a motion
# What slows down to a stop goes as far in its last frames as noise does, and a coder that leaves a
# picture as it is shows it where it was: errors were 3 times, once 15 times, those of a rest.
SETTLES = WINDOW // 2 + SETTLES_FRAMES
CODED_ANEW = 2.0  # a step by so many of all others of a window
MIN_WINDOWS = 20  # fewer do not tell a variance
LEAST_SCALE = 0.3  # a coder repeats what stands still: less scatter than that is no less noise
PIECE = 120  # frames whose likelihood is computed together
MOST = 3 * PIECE  # frames of a rest before a motion, or after it: more tell nothing of it
FRESH = 0.01  # of errors that last so much is another from frame to frame
TAUS = np.array([1.0, 2.0, 4.0, 8.0, 16.0, 32.0])  # frames
# Of the variance in motion, less what scatters at rest: what has come to rest is coded again, frame
# after frame, until hardly anything is left: 0.16 and 0.34 of it (x, y; object 2 in 120 rendered
# clips that were looked at, MPEG-4), 0.41 and 0.51 (10 in H.264), 0.06 and 0.34 (10 in H.265).
SHIFT_SHARE = 0.4
FAINT = 0.1  # of the independent errors: a weaker pattern of errors is left out
Kinds = Float[np.ndarray, " kind"]
"""One for independent errors, then one for each tau."""


def with_errors_at_rest(observation: Observation) -> Observation:
    """The observation with the covariance of what rests, in `modes_m` what frames share of it."""
    looks = [_look(observation, i) for i in range(len(observation.mask))]
    far = [(i, part) for i, (rests, _) in enumerate(looks) for part in _far(observation, i, rests)]
    if far:
        for i, part in far:
            observation = observation.without(part, i)
        return with_errors_at_rest(observation)
    scatter = np.concatenate([own for _, own in looks])
    if not scatter.size:
        return observation
    # The median: a window that holds the begin of a motion does not count.
    share = float(np.median(scatter) / chdtri(WINDOW - 1, 0.5))
    usual = float(np.clip(share, LEAST_SCALE**2, 1.0)) if len(scatter) >= MIN_WINDOWS else 1.0
    covariance, shifts, errors = observation.covariance_m2.copy(), [], []
    for i, (rests, _) in enumerate(looks):
        shifts += _shifts(observation, i, rests, usual)
        if len(scatter) < MIN_WINDOWS:
            continue
        for rest, axis in product(rests, range(observation.position_m.shape[1])):
            sd = np.sqrt(observation.covariance_m2[i, axis, axis, rest])
            single, together = _errors(observation.position_m[i, axis, rest], sd, usual)
            covariance[i, axis, :, rest] *= np.sqrt(single)
            covariance[i, :, axis, rest] *= np.sqrt(single)
            least = FAINT * single / max(np.linalg.eigvalsh(together)[-1], 1e-300)
            patterns = random_patterns(together, least)
            errors += [alone(observation.position_m, i, axis, own * sd, rest) for own in patterns]
    return replace(observation.with_modes(shifts, errors), covariance_m2=covariance)


def _far(observation: Observation, i: int, rests: Sequence[slice]) -> list[slice]:
    """What of the first and the last rest of an object is far from its motion."""
    seen, found = np.flatnonzero(observation.mask[i]), []
    for rest in rests:
        if rest.stop - rest.start <= 2 * MOST:
            continue
        if rest.start <= seen[0] + SETTLES:
            found.append(slice(rest.stop - MOST))
        elif rest.stop > seen[-1]:
            found.append(slice(rest.start + MOST, None))
    return found


def _shifts(
    observation: Observation, i: int, rests: Sequence[slice], usual: float
) -> list[Float[np.ndarray, "object axis frame"]]:
    """Of each rest of object `i` that follows a motion, one along each axis.

    A share of the variance while it moves, less what scatters at rest.
    """
    variance, found = np.diagonal(observation.covariance_m2[i]).T, []
    moving = observation.mask[i].copy()
    for rest in rests:
        moving[rest] = False
    for rest in rests:
        if not moving[: rest.start].any():
            continue
        in_motion = np.median(variance[:, moving], axis=1)
        shift2 = SHIFT_SHARE * (in_motion - usual * np.median(variance[:, rest], axis=1))
        found += [
            alone(observation.position_m, i, axis, np.sqrt(shift2[axis]), rest)
            for axis in np.flatnonzero(shift2 > 0).tolist()
        ]
    return found


def _look(observation: Observation, i: int) -> tuple[list[slice], Float[np.ndarray, " window"]]:
    """When object `i` rests, and in each axis of each window in which it does its scatter.

    The scatter is the sum of squares about the window's mean in units of the stated variance. What
    is coded anew in the middle of a window may go as far as errors do, and rests nevertheless. Of
    rests that follow a motion without the first frames: there it comes to rest.
    """
    mask, windows = observation.mask[i], np.lib.stride_tricks.sliding_window_view
    if len(mask) < WINDOW:
        return [], np.zeros(0)
    seen = windows(mask, WINDOW).all(axis=-1)
    sd = windows(np.sqrt(np.diagonal(observation.covariance_m2[i]).T), WINDOW, axis=-1)
    far = np.maximum(STILL_SDS * sd[:, seen].max(axis=(1, 2), initial=0.0), AWAY_M)[:, None]
    step = np.diff(observation.position_m[i])
    inner = windows(step, WINDOW - 1, axis=-1).copy()
    middle = inner[..., WINDOW // 2 - 1 : WINDOW // 2 + 1]
    others = np.delete(np.abs(inner), [WINDOW // 2 - 1, WINDOW // 2], axis=-1).max(axis=-1)
    stands_out = np.abs(middle) > CODED_ANEW * others[..., None]  # as in no steady motion
    middle[stands_out & (np.abs(middle) < far[..., None])] = 0.0
    path = np.cumsum(np.pad(inner, ((0, 0), (0, 0), (1, 0))), axis=-1)
    white = (path - path.mean(axis=-1, keepdims=True)) / sd
    still = seen & (np.nan_to_num(np.abs(white).max(axis=(0, 2)), nan=np.inf) < STILL_SDS)
    is_rest = np.convolve(still, np.ones(WINDOW)) > 0
    is_rest[1:] &= ~(np.abs(step) > far).any(axis=0)  # it has moved, within a frame
    rests = [
        slice(
            rest.start + (SETTLES if rest.start else 0),
            rest.stop - (BESIDE if rest.stop < len(mask) else 0),
        )
        for rest in stretches(is_rest)
    ]
    return [r for r in rests if r.start < r.stop], (white[:, still] ** 2).sum(axis=-1).reshape(-1)


def _errors(
    place_m: Float[np.ndarray, " frame"], sd_m: Float[np.ndarray, " frame"], usual: float
) -> tuple[float, Float[np.ndarray, "frame frame"]]:
    """The variance of independent errors and the covariance of those that last, over the stated.

    Of a coordinate of one rest; `usual` is the variance of what rests in this clip over the stated.
    """
    pieces = np.array_split(np.arange(len(sd_m)), max(1, round(len(sd_m) / PIECE)))
    parts = [_likelihood(place_m[own], sd_m[own]) for own in pieces]
    determinant, square = (np.sum(each, axis=0) for each in zip(*parts, strict=True))
    square += (WINDOW - 1) * usual
    degrees = len(sd_m) - len(pieces) + WINDOW - 1
    evidence = -(determinant + degrees * np.log(square)) / 2
    weight = np.exp(evidence - logsumexp(evidence)) * square / (degrees - 2)
    lasting = (1 - FRESH) * np.einsum("k,kab->ab", weight[1:], _kernels(len(sd_m)))
    single = float(weight[0] + FRESH * weight[1:].sum())
    # Not among the independent ones: how large those are in motion a frozen picture does not tell.
    return single, lasting + max(LEAST_SCALE**2 - single, 0.0) * np.eye(len(sd_m))


def _likelihood(
    place_m: Float[np.ndarray, " frame"], sd_m: Float[np.ndarray, " frame"]
) -> tuple[Kinds, Kinds]:
    """Of a piece without its place: log-determinant and sum of squares, for v = 1."""
    size = len(place_m)
    covers = FRESH * np.eye(size) + (1 - FRESH) * _kernels(size)
    away = (place_m - place_m.mean()) / sd_m
    return restricted_likelihood(np.array([np.eye(size), *covers]), 1 / sd_m[:, None], away)


def _kernels(size: int) -> Float[np.ndarray, "tau frame frame"]:
    apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    return np.exp(-apart / TAUS[:, None, None])

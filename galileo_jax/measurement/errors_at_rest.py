"""Errors of an object at rest that follow each other from frame to frame.

A coder repeats what does not change, and with it its error, until the next whole frame. Taken as
independent, such errors look like a small slow motion of a thing that nothing moves. Each
coordinate of each rest is therefore described as

    measured = place + error,    error ~ v ((1 - w) 1 + w K),    K = exp(-|frames apart| / tau),

and given the covariance that follows, averaged over w and tau by the likelihood with the place and
v left open. v is never less than what the clip's rests have on average: a rest that scatters less
by chance, or because the coder froze it, is no better known.

Source: Patterson and Thompson (1971), Recovery of inter-block information when block sizes are
unequal, Biometrika 58, 545 (the likelihood of covariances, without the mean).
"""

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

PIECE = 48  # frames whose likelihood is computed together
MOST_VARIANCE = 4.0  # of what rests of the clip have: more is a motion
SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)
TAUS = (1.0, 1.5, 2.5, 4.0, 7.0)  # frames
Errors = Float[np.ndarray, " errors"]


def errors_at_rest(
    place_m: Float[np.ndarray, " frame"], sd_m: Float[np.ndarray, " frame"], first: int, after: int
) -> tuple[float, Float[np.ndarray, "frame frame"]]:
    """The variance of independent errors and the covariance of others, in one rest.

    Args:
      place_m: a coordinate.
      sd_m: the standard deviation that rests of this clip have on average.
      first: the first of those that are surely at rest; only they are looked at.
      after: the end of these, more than three frames later.

    Returns:
      both in units of `sd_m`, for all frames.
    """
    count = max(1, round((after - first) / PIECE))
    pieces = np.array_split(np.arange(first, after), count)
    parts = [_likelihood(place_m[own], sd_m[own]) for own in pieces]
    determinant, square = (np.sum(each, axis=0) for each in zip(*parts, strict=True))
    degrees = after - first - count
    # Independent errors are as probable beforehand as all others together.
    prior = np.full(len(square), -np.log(len(square) - 1))
    prior[0] = 0.0
    evidence = prior - (determinant + degrees * np.log(np.maximum(square, 1e-300))) / 2
    probability = np.exp(evidence - logsumexp(evidence))
    variance = np.clip(square / (degrees - 2), 1.0, MOST_VARIANCE)
    weight = probability * variance
    shares = np.array([0.0, *(share for share in SHARES for _ in TAUS)])
    alone = float(weight @ (1 - shares))
    of_tau = (weight * shares)[1:].reshape(len(SHARES), len(TAUS)).sum(axis=0)
    return alone, np.einsum("k,kab->ab", of_tau, _kernels(len(place_m)))


def _likelihood(
    place_m: Float[np.ndarray, " frame"], sd_m: Float[np.ndarray, " frame"]
) -> tuple[Errors, Errors]:
    """Of a piece without its place: log-determinant and sum of squares, for v = 1.

    The first errors are independent, the others in the order of `SHARES`, then `TAUS`.
    """
    size = len(place_m)
    kernels = _kernels(size)
    covers = [np.eye(size)]
    covers += [(1 - w) * np.eye(size) + w * kernel for w in SHARES for kernel in kernels]
    root = np.linalg.cholesky(np.array(covers))
    both = np.linalg.solve(root, np.column_stack([1 / sd_m, (place_m - place_m.mean()) / sd_m]))
    still, white = both[..., 0], both[..., 1]
    information = np.sum(still**2, axis=-1)
    square = np.sum(white**2, axis=-1) - np.sum(still * white, axis=-1) ** 2 / information
    determinant = 2 * np.log(np.einsum("...nn->...n", root)).sum(axis=-1) + np.log(information)
    return determinant, square


def _kernels(size: int) -> Float[np.ndarray, "tau frame frame"]:
    apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    return np.exp(-apart / np.array(TAUS)[:, None, None])

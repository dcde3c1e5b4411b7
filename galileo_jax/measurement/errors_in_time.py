"""Do the errors of a track that others measured follow each other from row to row?

Marks set by hand, readings filled in between others and filtered positions are smoother than their
errors are large. Taken as independent they look like a small force. So, before any physics, each
coordinate is described as

    measured = smooth path + error,    error ~ s^2 sd^2 ((1 - w) 1 + w K_tau)

in pieces of the track. The path is a parabola and a thrice integrated white noise of any size, so
that no motion counts as error, and a jump of the velocity makes the path of its piece as rough as
it must be; K is exp(-|dt| / tau) or exp(-(dt / tau)^2 / 2), over a few rows. If correlated errors
explain the coordinate much better than independent ones, its covariance is that of the errors so
found, averaged over w, tau and s; else it is left as it was stated.

What is slower than a few rows is a path as well as an error: no track tells these apart.

Source: Wahba (1978), Improper priors, spline smoothing and the problem of guarding against model
errors in regression, J. R. Statist. Soc. B 40, 364 (the path); Rasmussen and Williams (2006),
Gaussian Processes for Machine Learning, section 2.7 (the marginal likelihood).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from galileo_jax.clip.plane_noise import position_noise_m
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.random_patterns import random_patterns

# Nats a piece, by which they must explain a track better: 300 independent ones reached 1.9.
CONVINCING = 2.0
PIECE, LEAST_ROWS, MOST_PIECES = 48, 16, 6
# Smoother than a tenth of what is stated: made without errors, or nobody can tell.
LEAST_ROUGHNESS = 0.1
ROWS = (
    *(("exp", 1.0), ("exp", 1.5), ("exp", 2.5), ("exp", 4.0), ("exp", 7.0)),
    *(("bell", 1.2), ("bell", 1.7), ("bell", 2.4)),
)
SHARES = (0.3, 0.5, 0.7, 0.85, 0.95)
SCALES = np.geomspace(0.1, 2.0, 25)
PATHS = np.geomspace(1.0, 1e7, 12)  # of the third derivative's noise: sd over a piece's length^2.5
FAINT = 0.01  # of the independent part: what is smaller among the shared patterns is left out


def with_errors_in_time(observation: Observation) -> tuple[Observation, list[str]]:
    """The observation with correlated errors where a coordinate shows them, and who shows them.

    Args:
      observation: in the picture's plane; its errors as stated, or told from their roughness.

    Returns:
      the observation: where errors follow each other its covariance is their independent part's,
      and the rest is among `modes_m`; and for each such coordinate what was found, in words.
    """
    found, said = [], []
    covariance = observation.covariance_m2.copy()
    for i, name in enumerate(observation.names):
        rows = np.flatnonzero(observation.mask[i])
        times = observation.times_s[rows]
        for a, axis in enumerate(observation.axes):
            sd = float(np.sqrt(np.median(covariance[i, a, a, rows])))
            shared = shared_errors(times, observation.position_m[i, a, rows] / sd)
            if shared is None:
                continue
            alone, together = shared
            size = np.sqrt(covariance[i, a, a, rows])
            share = together[0, 0] / (alone + together[0, 0])
            root = np.where(np.arange(len(covariance[i])) == a, np.sqrt(alone), 1.0)
            covariance[i] *= (root[:, None] * root)[..., None]
            least = FAINT * alone / max(float(np.linalg.eigvalsh(together)[-1]), FAINT)
            for pattern in random_patterns(together, least):
                own = np.zeros_like(observation.position_m)
                own[i, a, rows] = pattern * size
                found.append(own)
            lasts = float(np.trapezoid(together[0] / together[0, 0], times))
            said.append(
                f"{name}: errors in {axis} are correlated in time: {100 * share:.0f} % of "
                f"their variance, over {lasts:.2g} s; taken into account"
            )
    if not found:
        return observation, []
    before = [] if observation.modes_m is None else list(observation.modes_m)
    modes = np.stack([*before, *found])
    seen = replace(observation, covariance_m2=covariance, modes_m=modes, num_errors=len(found))
    return seen, said


def shared_errors(
    times_s: Float[np.ndarray, " row"],
    values: Float[np.ndarray, " row"],
    is_once_enough: bool = False,
    paths: Float[np.ndarray, " path"] = PATHS,
) -> tuple[float, Float[np.ndarray, "row row"]] | None:
    """The variance of independent errors and the covariance of others; None if there are none.

    Args:
      times_s: of the rows.
      values: in units of the stated standard deviation, as are both results.
      is_once_enough: whether errors that only one half of the rows shows are errors, too.
      paths: how rough the path may be.
    """
    if len(values) < LEAST_ROWS or position_noise_m(times_s, values) < LEAST_ROUGHNESS:
        return None
    step_s = float(np.median(np.diff(times_s)))
    count = max(1, round(len(values) / PIECE))
    pieces = np.array_split(np.arange(len(values)), count)
    if count > MOST_PIECES:
        pieces = [pieces[j] for j in np.linspace(0, count - 1, MOST_PIECES).astype(int)]
    half = len(pieces) // 2

    def evidence_of(some: Sequence[np.ndarray]) -> Float[np.ndarray, "errors scale"]:
        return np.sum([_evidence(times_s[own], values[own], step_s, paths) for own in some], axis=0)

    # What happens once, as a motion that begins, is no error: those are alike in both halves.
    by_half = []
    for own in (pieces[:half], pieces[half:]) if half else zip(np.array_split(pieces[0], 2)):
        by_half.append(evidence_of(own))
        if _lead(by_half[-1]) < 0 and not is_once_enough:
            return None
    evidence = np.sum(by_half, axis=0) if half else evidence_of(pieces)
    if _lead(evidence) < CONVINCING * len(pieces):
        return None
    weight = np.exp(evidence[1:] - logsumexp(evidence[1:])) @ SCALES**2  # [kernel and share]
    weight = weight.reshape(len(ROWS), len(SHARES))
    alone = float(np.sum(weight * (1 - np.array(SHARES))))
    together = np.einsum("k,kab->ab", weight @ SHARES, _kernels(times_s, step_s))
    return alone, together


def _evidence(
    times_s: np.ndarray, values: np.ndarray, step_s: float, paths: np.ndarray
) -> Float[np.ndarray, "errors scale"]:
    """The log marginal likelihood of a piece; row 0: independent errors, then `ROWS` x `SHARES`.

    Restricted to what no parabola takes up; the path's size is averaged over.
    """
    size = len(values)
    errors = [np.eye(size)]
    for kernel in _kernels(times_s, step_s):
        errors += [(1 - share) * np.eye(size) + share * kernel for share in SHARES]
    since = (times_s - times_s[0]) / (times_s[-1] - times_s[0])
    # The path in units of the errors, so that the scale of both comes out at the end.
    cover = np.array(errors)[:, None] + paths[:, None, None] ** 2 * smooth_path(since)
    root = np.linalg.cholesky(cover)
    parabola = np.vander(since, 3)
    both = np.linalg.solve(root, np.column_stack([parabola, values]))
    basis, upper = np.linalg.qr(both[..., :3])
    along = np.einsum("...nk,...n->...k", basis, both[..., 3])
    square = np.sum(both[..., 3] ** 2, axis=-1) - np.sum(along**2, axis=-1)
    diagonal = np.log(np.einsum("...nn->...n", root)).sum(-1)
    diagonal += np.log(np.abs(np.einsum("...nn->...n", upper))).sum(-1)
    log_density = -diagonal[..., None] - (size - 3) * np.log(SCALES)
    log_density = log_density - square[..., None] / (2 * SCALES**2)
    return np.asarray(logsumexp(log_density, axis=1)) - np.log(len(paths))


def _lead(evidence: np.ndarray) -> float:
    """By how many nats correlated errors explain better what `_evidence` is of."""
    correlated = logsumexp(evidence[1:]) - np.log(evidence[1:].size)
    return float(correlated - logsumexp(evidence[0]) + np.log(len(SCALES)))


def _kernels(times_s: np.ndarray, step_s: float) -> Float[np.ndarray, "kernel row row"]:
    apart = np.abs(times_s[:, None] - times_s) / step_s
    return np.array(
        [
            np.exp(-apart / rows) if kind == "exp" else np.exp(-0.5 * (apart / rows) ** 2)
            for kind, rows in ROWS
        ]
    )


def smooth_path(since: np.ndarray) -> Float[np.ndarray, "row row"]:
    """The covariance of thrice integrated white noise: int_0^s (s-u)^2 (t-u)^2 / 4 du, s <= t."""
    first = np.minimum(since[:, None], since)
    gap = np.abs(since[:, None] - since)
    return first**5 / 20 + gap * first**4 / 8 + gap**2 * first**3 / 12

"""How sizes and lengths of a Gaussian-process acceleration are found: their marginal likelihood.

    a ~ GP(0, s^2 (1 + M(|u - u'| / l))),    u = time since the release, or place along the path

M is the Matern-5/2 covariance. The 1 is a constant as large as what varies about it: a force that
nobody named is seldom zero on average, and friction takes up its average. Clips share one function
of u. All objects share l: one that moves for a short while sees little but a constant of a slow
force. Before the data it is as probable as not that they share s, too, as where a law acts on all.
The whitened residuals are linear in the accelerations w at the knots, and all else that is unknown
has been made part of the noise,

    y = -B w + N(0, 1),    log p(y | s, l) = (b' M^-1 b - log det M) / 2,

    M = 1 + C' B' B C,  b = C' B' y,  w = C v,  v ~ N(0, 1),

so that a grid of hyperparameters costs no rollouts.

Source: Kennedy and O'Hagan (2001), Bayesian calibration of computer models, J. R. Stat. Soc. B 63,
425; Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, sections 4.2 and 5.4.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.special import softmax

Of = Literal["time", "place"]
OF: tuple[Of, ...] = ("time", "place")
LENGTHS = (0.1, 0.2, 0.4, 0.8)  # over the longest way or time in which an object moves
# Nothing at all, as probable as all the others together; and each 2.15 times the last.
SIZES_M_S2 = np.array([0.0, *np.geomspace(0.001, 10.0, 13)])
JITTER = 1e-8


@dataclass(frozen=True)
class Knots:
    """An object's knots in all clips.

    Attributes:
      response: `[value, knot]`, B: how accelerations show in the whitened residuals, s^2/m.
      time_s, place_m: `[knot]`.
    """

    response: np.ndarray
    time_s: np.ndarray
    place_m: np.ndarray

    def at(self, of: Of) -> np.ndarray:
        """Where they stand in what the acceleration is a function of."""
        return self.time_s if of == "time" else self.place_m


class Size(NamedTuple):
    """Hyperparameters.

    Attributes:
      of: what the acceleration is a function of.
      length: over the largest extent of an object in it.
      sizes_m_s2: of each object.
    """

    of: Of
    length: float
    sizes_m_s2: tuple[float, ...]

    def roots(self, knots: Sequence[Knots]) -> list[np.ndarray]:
        """C of each object, `[knot, knot]`: accelerations from unit normals, m/s^2."""
        roots = unit_roots(knots, self.of, self.length)
        return [size * root for root, size in zip(roots, self.sizes_m_s2, strict=True)]


def unit_roots(knots: Sequence[Knots], of: Of, length: float) -> list[np.ndarray]:
    """Of each object, with a size of 1; `length` over the largest extent of an object."""
    extent = max(1e-6, *(float(np.ptp(own.at(of))) for own in knots))
    return [unit_root(own.at(of), length * extent) for own in knots]


def unit_root(at: np.ndarray, length: float) -> np.ndarray:
    """The Cholesky factor of 1 + M between knots at `at` `[knot]`, in whose unit `length` is."""
    apart = np.sqrt(5) * np.abs(np.subtract.outer(at, at)) / length
    matern = (1 + apart + apart**2 / 3) * np.exp(-apart)
    return np.linalg.cholesky(1.0 + matern + JITTER * np.eye(len(at)))


def probable_sizes(
    target: np.ndarray, knots: Sequence[Knots], sizes_m_s2: np.ndarray = SIZES_M_S2
) -> tuple[list[Size], np.ndarray]:
    """All hyperparameters of the grid and their probabilities.

    Args:
      target: `[value]`, y.
      knots: of each object, which may all have other sizes; length and kind are common.
      sizes_m_s2: the grid of sizes, the first 0.

    Returns:
      The grid, and `[size]`, which sums to 1.
    """
    found, log_evidence = [], []
    for of, length in product(OF, LENGTHS):
        roots = unit_roots(knots, of, length)
        design = np.concatenate(
            [own.response @ root for own, root in zip(knots, roots, strict=True)], axis=1
        )
        owner = np.repeat(np.arange(len(knots)), [own.response.shape[1] for own in knots])
        gram, pulled = design.T @ design, design.T @ target
        for chosen in product(sizes_m_s2, repeat=len(knots)):
            scale = np.asarray(chosen)[owner]
            normal = np.eye(len(scale)) + scale[:, None] * gram * scale
            factor = cho_factor(normal, lower=True)
            b = scale * pulled
            gain = b @ cho_solve(factor, b)
            log_evidence.append(0.5 * gain - float(np.sum(np.log(np.diag(factor[0])))))
            log_evidence[-1] += np.log(_prior(chosen, len(sizes_m_s2)))
            found.append(Size(of, length, tuple(float(s) for s in chosen)))
    return found, softmax(np.array(log_evidence))


def _prior(sizes_m_s2: Sequence[float], num_sizes: int) -> float:
    """Before the data: half that all objects share a size, half that each has its own."""
    each = [0.5 if size == 0.0 else 0.5 / (num_sizes - 1) for size in sizes_m_s2]
    is_shared = all(size == sizes_m_s2[0] for size in sizes_m_s2)
    return 0.5 * math.prod(each) + 0.5 * is_shared * each[0]

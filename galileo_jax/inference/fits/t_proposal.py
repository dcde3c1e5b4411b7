"""Distributions to draw from by importance: elliptical ones, Student's t or normal.

Source: O. Cappé, R. Douc, A. Guillin, J.-M. Marin, C. P. Robert, Adaptive importance sampling in
general mixture classes, Stat. Comput. 18 (2008), 447 (10.1007/s11222-008-9059-x).
"""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import gammaln, softmax

from galileo_jax.inference.resampled import worth
from galileo_jax.numerics.normal_matrix import symmetric_root

FREEDOM = 5.0  # degrees of it, of Student's t
DRAWS_PER_PARAMETER = 4.0  # that weights must be worth, or they are flattened
LEAST_POWER = 1e-12  # not 0, whose product with the logarithm of no weight is no number
LEAST_VARIANCE = 1e-10  # in z, of a direction in which draws do not differ

Points = Float[np.ndarray, "draw parameter"]
Values = Float[np.ndarray, " draw"]


@runtime_checkable
class Proposal(Protocol):
    """A distribution of which draws and the density are known."""

    def draw(self, generator: np.random.Generator, num: int) -> tuple[Points, Values]:
        """Points, and their log density."""
        ...

    def log_density(self, z: Points) -> Values:
        """Of points, whoever drew them."""
        ...


@dataclass(frozen=True)
class Cloud:
    """An elliptical distribution of the free parameters; the others are 0."""

    mean: Float[np.ndarray, " free"]  # z
    # symmetric; its square is the covariance of a normal of the same width
    root: Float[np.ndarray, "free free"]
    free: Bool[np.ndarray, " parameter"]  # which parameters these are
    freedom: float = FREEDOM  # degrees of it, of Student's t; infinite: normal

    @classmethod
    def of(cls, z: Points, log_weights: Values, free: Bool[np.ndarray, " parameter"]) -> "Cloud":
        """The t with mean and covariance of draws, their weights flattened till enough count."""
        own = z[:, free]
        weights = softmax(_power(log_weights, DRAWS_PER_PARAMETER * own.shape[1]) * log_weights)
        mean = weights @ own
        far = own - mean
        return cls(mean, symmetric_root((weights * far.T) @ far, LEAST_VARIANCE), free)

    def draw(self, generator: np.random.Generator, num: int) -> tuple[Points, Values]:
        """See `Proposal`."""
        z = np.zeros((num, len(self.free)))
        u = student_t(generator, num, len(self.mean), self.freedom)
        z[:, self.free] = self.mean + u @ self.root
        return z, self.log_density(z)

    def log_density(self, z: Points) -> Values:
        """Of the free parameters."""
        u = np.linalg.solve(self.root, (z[:, self.free] - self.mean).T).T
        return log_student_t(u, self.freedom) - np.linalg.slogdet(self.root)[1]


def _power(log_weights: Values, enough: float) -> float:
    """The power of the weights, at most 1, by which they are worth so many draws.

    Nearly 0, where all of some weight weigh the same, if there are no more of these.
    """

    def left_over(power: float) -> float:
        return worth(power * log_weights) - enough

    if left_over(1.0) >= 0:
        return 1.0
    if left_over(LEAST_POWER) <= 0:
        return LEAST_POWER
    from scipy.optimize import root_scalar  # most draws never come here

    return float(root_scalar(left_over, bracket=(LEAST_POWER, 1.0)).root)


def log_student_t(u: Points, freedom: float = FREEDOM) -> Values:
    """The log density of a standard t, or normal; -inf where `u` is no number."""
    dim = u.shape[1]
    with np.errstate(over="ignore", invalid="ignore"):  # far off, where it draws none
        far = np.nan_to_num(np.sum(u**2, axis=1), nan=np.inf)
    if np.isinf(freedom):
        return -0.5 * far - dim / 2 * np.log(2 * np.pi)
    constant = (
        gammaln((freedom + dim) / 2) - gammaln(freedom / 2) - dim / 2 * np.log(np.pi * freedom)
    )
    return constant - (freedom + dim) / 2 * np.log1p(far / freedom)


def student_t(
    generator: np.random.Generator, num: int, dim: int, freedom: float = FREEDOM
) -> Float[np.ndarray, "draw dim"]:
    """Draws of it. SciPy's `multivariate_t` is the same; its import takes longer than the draws."""
    u = generator.standard_normal((num, dim))
    if np.isinf(freedom):
        return u
    return u / np.sqrt(generator.chisquare(freedom, num) / freedom)[:, None]

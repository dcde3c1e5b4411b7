"""Student's t that fits weighted draws: where a posterior is that no fit describes.

Draws whose weights are too unequal say, all the same, where the posterior is. With its mean and
covariance by weights that are flattened until enough draws count, a t covers it better than what
the draws were made from, and so on from there.

Source: O. Cappé, R. Douc, A. Guillin, J.-M. Marin, C. P. Robert, Adaptive importance sampling in
general mixture classes, Stat. Comput. 18 (2008), 447 (10.1007/s11222-008-9059-x).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import gammaln

from galileo_jax.inference.fits.normal_matrix import symmetric_root

DEGREES_OF_FREEDOM = 5.0
POWERS = (1.0, 0.7, 0.5, 0.35, 0.25, 0.15, 0.1, 0.05)  # of the weights, until enough draws count
DRAWS_PER_PARAMETER = 4.0
LEAST_VARIANCE = 1e-10  # in z, of a direction in which draws do not differ


@dataclass(frozen=True)
class Cloud:
    """Student's t of the free parameters.

    Attributes:
      mean: `[free]`, z.
      root: `[free, free]`, symmetric; its square is the covariance of a normal of the same width.
      free: `[parameter]`, which those are; the others are 0.
    """

    mean: Float[np.ndarray, " free"]
    root: Float[np.ndarray, "free free"]
    free: Bool[np.ndarray, " parameter"]

    @classmethod
    def of(
        cls,
        z: Float[np.ndarray, "draw parameter"],
        log_weights: Float[np.ndarray, " draw"],
        free: Bool[np.ndarray, " parameter"],
    ) -> "Cloud":
        """The t round weighted draws."""
        own = z[:, free]
        for power in POWERS:
            weights = np.exp(power * (log_weights - log_weights.max()))
            weights /= weights.sum()
            if 1 / np.sum(weights**2) > DRAWS_PER_PARAMETER * own.shape[1]:
                break
        mean = weights @ own
        far = own - mean
        return cls(mean, symmetric_root((weights * far.T) @ far, LEAST_VARIANCE), free)

    def draw(self, generator: np.random.Generator, num: int) -> tuple[np.ndarray, np.ndarray]:
        """Points, `[draw, parameter]`, z, and their log density."""
        z = np.zeros((num, len(self.free)))
        z[:, self.free] = self.mean + student_t(generator, num, len(self.mean)) @ self.root
        return z, self.log_density(z)

    def log_density(self, z: Float[np.ndarray, "draw parameter"]) -> np.ndarray:
        """Of the free parameters, `[draw]`."""
        u = np.linalg.solve(self.root, (z[:, self.free] - self.mean).T)
        return log_student_t(np.sum(u**2, axis=0), len(u)) - np.linalg.slogdet(self.root)[1]


def log_student_t(far: Float[np.ndarray, " draw"], dim: int) -> Float[np.ndarray, " draw"]:
    """The log density of a standard t in so many dimensions, at squared distances from its mean."""
    nu = DEGREES_OF_FREEDOM
    constant = gammaln((nu + dim) / 2) - gammaln(nu / 2) - dim / 2 * np.log(np.pi * nu)
    return constant - (nu + dim) / 2 * np.log1p(far / nu)


def student_t(generator: np.random.Generator, num: int, dim: int) -> Float[np.ndarray, "draw dim"]:
    """Draws of it. SciPy's `multivariate_t` is the same; its import takes longer than the draws."""
    u = generator.standard_normal((num, dim))
    chi = generator.chisquare(DEGREES_OF_FREEDOM, num) / DEGREES_OF_FREEDOM
    return u / np.sqrt(chi)[:, None]

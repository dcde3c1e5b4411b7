"""The inverse of 1 + J^T J, whose eigenvalues are at least 1, however steep the slopes J are.

In units in which every prior is a unit normal, no quantity is known less well than by its prior.
Rounding forgets that where slopes are a hundred million: of 1e22 the 1 is not left, and the sum
may be singular. So eigenvalues that come out below 1 count as 1.
"""

import numpy as np
from jaxtyping import Float


def inverse(normal: Float[np.ndarray, "*batch n n"]) -> Float[np.ndarray, "*batch n n"]:
    """The inverse of symmetric matrices none of whose eigenvalues is truly below 1."""
    values, vectors = np.linalg.eigh(normal)
    return (vectors / np.maximum(values, 1.0)[..., None, :]) @ np.swapaxes(vectors, -1, -2)


def symmetric_root(
    covariance: Float[np.ndarray, "*batch n n"], least: float = 0.0
) -> Float[np.ndarray, "*batch n n"]:
    """The symmetric S with S S = covariance, eigenvalues below `least` counting as that.

    Fixed random numbers times S are draws that change smoothly with the covariance. Times a matrix
    of eigenvectors they would not: these have no sign and, where eigenvalues are equal, no order.
    Where a hypothesis is absurd its slopes are, too, and rounding may leave an eigenvalue below 0.
    """
    values, vectors = np.linalg.eigh(covariance)
    roots = np.sqrt(np.maximum(values, least))
    return (vectors * roots[..., None, :]) @ np.swapaxes(vectors, -1, -2)

"""A random function of time as a few patterns, each with an independent amplitude."""

from typing import Any

import numpy as np
from jaxtyping import Float

SMALLEST = 1e-3  # of the largest pattern's variance; what is smaller is left out


def random_patterns(
    covariance: Float[np.ndarray, "frame frame"], smallest: float = SMALLEST
) -> Float[np.ndarray, "pattern frame"]:
    """The patterns of a covariance, each times the standard deviation of its amplitude.

    Source: Karhunen and Loeve; Rasmussen and Williams (2006), Gaussian Processes, section 4.3.
    """
    values, vectors = np.linalg.eigh(covariance)
    large = values > smallest * values[-1]
    return (np.sqrt(values[large]) * vectors[:, large]).T


def alone(
    position: Float[np.ndarray, "object axis frame"],
    i: int,
    axis: int | slice,
    values: Any,
    frames: slice | np.ndarray = slice(None),
) -> Float[np.ndarray, "object axis frame"]:
    """A pattern of the shape of `position` that moves object i along an axis in some frames."""
    found = np.zeros_like(position)
    found[i][axis, frames] = values
    return found

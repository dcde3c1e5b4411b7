"""A Latin hypercube: points of which each coordinate fills its range evenly."""

import numpy as np


def latin_hypercube(num_points: int, num_axes: int, rng: np.random.Generator) -> np.ndarray:
    """`[point, axis]` in 0 to 1: one point in each of `num_points` slices of every axis.

    The same numbers as `scipy.stats.qmc.LatinHypercube`, whose import takes half a second.

    Source: M. D. McKay, R. J. Beckman, W. J. Conover, Technometrics 21 (1979),
    doi:10.2307/1268522.
    """
    rng = rng.spawn(1)[0]
    within = rng.uniform(size=(num_points, num_axes))
    slices = np.tile(np.arange(1, num_points + 1), (num_axes, 1))
    for one in slices:
        rng.shuffle(one)
    return (slices.T - within) / num_points

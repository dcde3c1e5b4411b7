"""Draws out of weighed ones, each as often as it weighs.

Source: G. Kitagawa, Monte Carlo filter and smoother for non-Gaussian nonlinear state space models,
J. Comput. Graph. Stat. 5 (1996), 1.
"""

import numpy as np
from jaxtyping import Float, Int


def systematic(
    log_weights: Float[np.ndarray, " draw"], count: int, generator: np.random.Generator
) -> Int[np.ndarray, " chosen"]:
    """Indices of `count` draws, ascending: no draw comes in more or less often than its share.

    Evenly spaced through the weights, with one random number for all.
    """
    share = np.cumsum(np.exp(log_weights - np.max(log_weights)))
    places = (np.arange(count) + generator.uniform()) / count * share[-1]
    return np.minimum(np.searchsorted(share, places), len(share) - 1)

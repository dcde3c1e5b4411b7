"""The interval of a series of residuals that deviates most to one side."""

import numpy as np

FEWEST = 3  # values in an interval


def worst_interval(values: np.ndarray) -> tuple[int, int, float] | None:
    """The interval of largest |sum| / sqrt(n): its first and last value, and how large that is.

    Args:
      values: `[n]`, N(0, 1) where the model is right; no NaN.

    Returns:
      None with fewer than three values. White noise gives about 3.0 for 120 values.
    """
    if len(values) < FEWEST:
        return None
    sums = np.concatenate([[0.0], np.cumsum(values)])
    first, last = np.triu_indices(len(values) + 1, FEWEST)
    strength = np.abs(sums[last] - sums[first]) / np.sqrt(last - first)
    best = int(np.argmax(strength))
    return int(first[best]), int(last[best]) - 1, float(strength[best])

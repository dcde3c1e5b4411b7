"""The stretch of a track in which residuals deviate most, to one side."""

import numpy as np

LEAST_STRETCH = 3  # values


def strongest(values: np.ndarray) -> tuple[int, int, float] | None:
    """The window of largest |sum| / sqrt(n): its first and last value, and how large.

    Args:
      values: `[n]`, unit normal if there is nothing; no NaN.

    Returns:
      None with fewer than three values. White noise gives about 3.0 for 120 values.
    """
    if len(values) < LEAST_STRETCH:
        return None
    sums = np.concatenate([[0.0], np.cumsum(values)])
    first, last = np.triu_indices(len(values) + 1, LEAST_STRETCH)
    strength = np.abs(sums[last] - sums[first]) / np.sqrt(last - first)
    best = int(np.argmax(strength))
    return int(first[best]), int(last[best]) - 1, float(strength[best])

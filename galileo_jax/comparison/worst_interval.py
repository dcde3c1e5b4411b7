"""The interval of a series of residuals that deviates most to one side."""

from dataclasses import dataclass

import numpy as np

FEWEST = 3  # values in an interval


@dataclass(frozen=True)
class Interval:
    """Of residuals: when, and |sum| / sqrt(number), in units of the noise."""

    start_s: float
    end_s: float
    z: float


def worst_interval(values: np.ndarray, times_s: np.ndarray) -> Interval | None:
    """The interval of largest |sum| / sqrt(number).

    `values` `[frame]` are N(0, 1) where the model is right; NaN is left out.

    Returns:
      None with fewer than three values. White noise gives a z of about 3.0 for 120 values.
    """
    known = np.isfinite(values)
    if known.sum() < FEWEST:
        return None
    sums, times = np.concatenate([[0.0], np.cumsum(values[known])]), times_s[known]
    first, last = np.triu_indices(len(sums), FEWEST)
    strength = np.abs(sums[last] - sums[first]) / np.sqrt(last - first)
    best = int(np.argmax(strength))
    return Interval(float(times[first[best]]), float(times[last[best] - 1]), float(strength[best]))

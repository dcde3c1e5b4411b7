"""The least-squares periodogram."""

import math

import numpy as np

from galileo_jax.numerics.least_squares import LinearFit, least_squares

MANY_PERIODS = 400  # tried


def period_s(times_s: np.ndarray, values: np.ndarray) -> float:
    """The period of the sine that leaves least over, s (a least-squares periodogram)."""
    if len(times_s) < 5:
        return 1.0
    span = float(times_s[-1] - times_s[0])
    step = float(np.median(np.diff(times_s)))
    periods = np.geomspace(3 * step, 2 * span, MANY_PERIODS)
    left = [np.sum(sine_through(times_s, values, period).left ** 2) for period in periods]
    return float(periods[np.argmin(left)])


def sine_through(times_s: np.ndarray, values: np.ndarray, period_s: float) -> LinearFit:
    """The offset, and the cosine and sine of a period from the first time on, through values."""
    turn = 2 * math.pi * (times_s - times_s[0]) / period_s
    return least_squares(np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)], axis=1), values)

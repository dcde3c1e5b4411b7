"""The least-squares periodogram."""

import math

import numpy as np

MANY_PERIODS = 400  # tried


def period_s(times_s: np.ndarray, values: np.ndarray) -> float:
    """The period of the sine that leaves least over, s (a least-squares periodogram)."""
    if len(times_s) < 5:
        return 1.0
    span = float(times_s[-1] - times_s[0])
    step = float(np.median(np.diff(times_s)))
    periods = np.geomspace(3 * step, 2 * span, MANY_PERIODS)
    left = []
    for period in periods:
        turn = 2 * math.pi * (times_s - times_s[0]) / period
        design = np.stack([np.ones_like(turn), np.cos(turn), np.sin(turn)], axis=1)
        solution = np.linalg.lstsq(design, values, rcond=None)[0]
        left.append(np.sum((values - design @ solution) ** 2))
    return float(periods[np.argmin(left)])

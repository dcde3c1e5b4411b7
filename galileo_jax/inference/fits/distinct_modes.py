"""Fits of one hypothesis in several valleys: which of them count beside the best."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.inference.fits.descent import SAME_VALLEY_NATS
from galileo_jax.inference.fits.laplace import GradientFit

MOST_ADDED, ADDS_NATS = 3, 3.0  # valleys whose evidence adds up, unless so far behind the best


def apart(fits: Sequence[GradientFit]) -> list[GradientFit]:
    """The best fit, and those of other valleys that add to its evidence, best first."""
    left, found = sorted(fits, key=lambda fit: -fit.log_evidence), []
    while left and len(found) < MOST_ADDED:
        first = left.pop(0)
        found.append(first)
        inverse = np.linalg.pinv(first.covariance, hermitian=True)
        steps = [fit.z - first.z for fit in left]
        is_near = [0.5 * step @ inverse @ step < SAME_VALLEY_NATS for step in steps]
        least = found[0].log_evidence - ADDS_NATS
        left = [
            fit
            for fit, near in zip(left, is_near, strict=True)
            if not near and fit.log_evidence > least
        ]
    return found

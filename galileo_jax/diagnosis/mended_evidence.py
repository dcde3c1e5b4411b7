"""The evidence of hypotheses where a nat or two decides: of all valleys, and by rollouts."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.inference.fits.descent import SAME_VALLEY_NATS
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.fits.weighed import Weighed, weighed

MOST_ADDED, ADDS_NATS = 3, 3.0  # valleys whose evidence adds up, unless so far behind the best


def mended(
    fitter: GradientFitter, fits: Sequence[GradientFit], seed: int, without: GradientFit | None
) -> tuple[GradientFit, Weighed | None]:
    """The best fit of a hypothesis, and its evidence as `weighed`; None where Laplace's will do.

    A draw that is better than all fits is where one of them goes on.
    """
    valleys = apart(fits)
    found = weighed(valleys, fitter.residuals, seed, without)
    if found.better is not None:
        count = len(valleys[0].steps)
        free = valleys[0].free[:count]
        polished = fitter.polish(found.better[None, :count], free[None], np.zeros(1, int))
        valleys = apart([*valleys, *polished.values()])
        found = weighed(valleys, fitter.residuals, seed, without)
    return valleys[0], found if found.is_sure else None


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

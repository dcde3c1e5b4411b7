"""The evidence of hypotheses where a nat or two decides: of all valleys, and by rollouts."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.inference.fits.apart import apart
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.fits.weighed import Weighed, weighed


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

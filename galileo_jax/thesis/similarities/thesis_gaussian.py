"""The thesis's Gaussian similarity: independent normal errors of one variance."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from galileo_jax.thesis.similarity import AbstractSimilarity, register


@register
class GaussianSimilarity(AbstractSimilarity):
    """Sum over measured velocities of log N(observed; predicted, variance).

    Normalized, but of a noise that velocities from tracked positions do not have: theirs
    is correlated between neighbours, and far smaller than sqrt(0.05) = 0.22 m/s. For an
    honest posterior use `Whitening.log_density`. The thesis does not state the variance's
    unit; we read (m/s)^2. Its own acceptance and selection only rank, so that its answer
    is the same for every variance.
    """

    name: ClassVar[str] = "thesis_gaussian"
    variance_m2_s2: float = 0.05

    def _of_measured(self, predicted, observed, mask) -> jax.Array:
        squares = (observed - predicted) ** 2 / self.variance_m2_s2
        constant = jnp.log(2 * jnp.pi * self.variance_m2_s2)
        return -0.5 * jnp.sum(jnp.where(mask, squares + constant, 0.0))

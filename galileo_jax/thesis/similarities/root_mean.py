"""Root mean similarity: how alike two profiles are, number by number, between 0 and 1."""

from typing import ClassVar

import jax
import jax.numpy as jnp

from galileo_jax.thesis.similarity import AbstractSimilarity, register


@register
class RootMeanSimilarity(AbstractSimilarity):
    """Root mean square over the measured velocities of s = 1 - |x - y| / (|x| + |y|).

    1 where the profiles are the same; 0 where every pair differs in sign or one of it is
    zero. Two zeros are alike (s = 1). A score. It is relative: the noise of an object at
    rest (x = 0, y = noise) counts as complete difference.

    Source: Cassisi, Montalto, Aliotta, Cannata, Pulvirenti, Similarity measures and
    dimensionality reduction techniques for time series data mining (2012), 10.5772/49941.
    """

    name: ClassVar[str] = "root_mean"

    def _of_measured(self, predicted, observed, mask) -> jax.Array:
        size = jnp.abs(predicted) + jnp.abs(observed)
        is_zero = size == 0
        alike = 1.0 - jnp.abs(predicted - observed) / jnp.where(is_zero, 1.0, size)
        total = jnp.sum(jnp.where(mask & ~is_zero, alike**2, 0.0)) + jnp.sum(mask & is_zero)
        mean = total / jnp.maximum(jnp.sum(mask), 1)
        # The root has no derivative at 0.
        return jnp.where(mean > 0, jnp.sqrt(jnp.where(mean > 0, mean, 1.0)), 0.0)

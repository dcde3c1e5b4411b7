"""How alike a predicted and a measured motion are."""

from galileo_jax.similarity import earth_mover, gaussian_similarity, root_mean
from galileo_jax.similarity.similarity import (
    AbstractSimilarity,
    similarity_class,
    similarity_names,
)

__all__ = [
    "AbstractSimilarity",
    "earth_mover",
    "gaussian_similarity",
    "root_mean",
    "similarity_class",
    "similarity_names",
]

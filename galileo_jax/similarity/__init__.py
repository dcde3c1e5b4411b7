"""How alike a predicted and a measured motion are."""

from galileo_jax.runtime.registry import load_entries
from galileo_jax.similarity.similarity import (
    AbstractSimilarity,
    similarity_class,
    similarity_names,
)

load_entries("galileo_jax.similarity.library")

__all__ = [
    "AbstractSimilarity",
    "similarity_class",
    "similarity_names",
]

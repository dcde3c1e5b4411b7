"""Which pairs of effects are tried where no single effect explains the data."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.verdict import NUM_JOINED


def pairs_with(best: Candidate, library: Sequence[str]) -> list[tuple[str, ...]]:
    """The best effect with each other effect of the library; the added one stands last."""
    return [(*best.effects, name) for name in library if name not in best.effects]


def with_largest_scores(
    pairs: Sequence[tuple[str, ...]], scores: np.ndarray
) -> list[tuple[str, ...]]:
    """The `NUM_JOINED` pairs that are most worth a fit, the most promising first.

    Args:
      pairs: from `pairs_with`.
      scores: `[pair]`, of the score test of the added effect (`candidates.score_tests`), in
        standard deviations.
    """
    return [pairs[i] for i in np.argsort(-scores)[:NUM_JOINED]]

"""How large imperfections were found to be."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from galileo_jax.statespace.term import USUAL


@dataclass(frozen=True)
class Sizes:
    """Sizes of terms: the most probable ones, and draws of what they may be."""

    names: tuple[str, ...]  # of the terms
    # Logarithms of the most probable sizes over their priors' medians, in units of the priors' sds
    x: Float[np.ndarray, " term"]
    # As `x`, and of each clip the noise scale's logarithm in the same way, as the data leave them
    # open
    draws: Float[np.ndarray, "draw term_and_clip"]
    log_evidence: float  # what having sizes adds to the log evidence at the most probable ones

    @property
    def unusual(self) -> list[str]:
        """Names of the terms that are larger than such things usually are.

        None where all may well be usual, in half of the draws; else those that are larger the
        oftenest: what one does another may do in its place.
        """
        is_large = self.draws[:, : len(self.x)] > USUAL
        if is_large.any(axis=1).mean() <= 0.5:
            return []
        often = is_large.mean(axis=0)
        return [n for n, share in zip(self.names, often, strict=True) if share > often.max() / 2]

    @property
    def by_name(self) -> dict[str, float]:
        """`x`."""
        return dict(zip(self.names, self.x.tolist(), strict=True))

"""How large imperfections were found to be."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from galileo_jax.statespace.term import USUAL


@dataclass(frozen=True)
class Sizes:
    """Sizes of terms: the most probable ones, and draws of what they may be.

    Attributes:
      names: of the terms.
      x: `[term]`, logarithms of the most probable sizes over their priors' medians, in units of
        the priors' sds.
      draws: `[draw, term and clip]`, as `x`, and of each clip the noise scale's logarithm in the
        same way, as the data leave them open.
      log_evidence: what having sizes adds to the log evidence at the most probable ones.
    """

    names: tuple[str, ...]
    x: Float[np.ndarray, " term"]
    draws: Float[np.ndarray, "draw term_and_clip"]
    log_evidence: float

    @property
    def unusual(self) -> list[str]:
        """Names of the terms that are larger than such things usually are."""
        return [name for name, x in self.by_name.items() if x > USUAL]

    @property
    def by_name(self) -> dict[str, float]:
        """`x`."""
        return dict(zip(self.names, self.x.tolist(), strict=True))

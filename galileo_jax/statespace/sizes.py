"""How large imperfections were found to be."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Sizes:
    """The most probable sizes of terms, and how well they are known.

    Attributes:
      names: of the terms.
      x: `[term]`, logarithms of the sizes over their priors' medians, in units of the priors' sds.
      information: `[term, term]`, of the log posterior of `x`, the prior included.
    """

    names: tuple[str, ...]
    x: Float[np.ndarray, " term"]
    information: Float[np.ndarray, "term term"]

    @property
    def log_evidence(self) -> float:
        """What having sizes adds to the log likelihood at the most probable ones, by Laplace."""
        return float(-0.5 * self.x @ self.x - 0.5 * np.linalg.slogdet(self.information)[1])

    @property
    def sd(self) -> Float[np.ndarray, " term"]:
        """Standard deviations of `x`."""
        return np.sqrt(np.diag(np.linalg.inv(self.information)))

    @property
    def by_name(self) -> dict[str, float]:
        """`x`."""
        return dict(zip(self.names, self.x.tolist(), strict=True))

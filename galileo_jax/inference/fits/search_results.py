"""Where the starts of a search ended, sorted by valleys."""

from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.inference.fits.descent import (
    SAME_VALLEY_NATS,
    Descended,
    ends_of,
    in_valley,
)
from galileo_jax.inference.fits.kernels import Quadratic

BEHIND_IN_SEARCH = 20.0  # starts of one hypothesis, in nats of the search's coarse noise
MOST_VALLEYS = 4  # that are polished


@dataclass(frozen=True)
class Ends:
    """Where a search ended.

    Attributes:
      best: the best point of every valley that is not far behind, best first.
      num_agreeing: starts that ended in the first's.
      num_steps: how many it took.
    """

    best: Quadratic
    num_agreeing: int
    num_steps: int

    @classmethod
    def of(cls, found: Descended) -> "Ends":
        """Sorts ends by valleys."""
        ends, whose = found.best, ends_of(found.joined)
        rows = valleys(ends, np.unique(whose))
        agree = in_valley(ends, rows[0], whose)
        return cls(Quadratic(*(leaf[rows] for leaf in ends)), int(agree.sum()), found.num_steps)

    @property
    def any(self) -> bool:
        """Whether there is one."""
        return len(self.best.z) > 0

    def without(self, known: "Ends") -> "Ends":
        """Those in valleys that another search has not come to."""
        rows = [i for i in range(len(self.best.z)) if not known.has(self.best, i)]
        return replace(self, best=Quadratic(*(leaf[rows] for leaf in self.best)))

    def has(self, other: Quadratic, row: int) -> bool:
        """Whether a point of `other` is in the valley of one of these, and hardly lower."""
        both = Quadratic(
            *(np.concatenate([a, b[[row]]]) for a, b in zip(self.best, other, strict=True))
        )
        last = np.array([len(self.best.z)])
        lowest = both.cost[last[0]] + SAME_VALLEY_NATS
        return any(
            both.cost[i] < lowest and in_valley(both, i, last)[0] for i in range(len(self.best.z))
        )


def valleys(ends: Quadratic, rows: np.ndarray) -> list[int]:
    """The best point of every valley among `rows` that is not far behind, best first."""
    left, found = rows[np.argsort(ends.cost[rows], kind="stable")], []
    left = left[ends.cost[left] < ends.cost[left[0]] + BEHIND_IN_SEARCH]
    while left.size and len(found) < MOST_VALLEYS:
        found.append(int(left[0]))
        left = left[~in_valley(ends, found[-1], left)]
    return found

"""Where the starts of a search ended, sorted by valleys."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.inference.fits.descent import Descended, ends_of, in_valley
from galileo_jax.inference.fits.programs import Quadratic

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


def valleys(ends: Quadratic, rows: np.ndarray) -> list[int]:
    """The best point of every valley among `rows` that is not far behind, best first."""
    left, found = rows[np.argsort(ends.cost[rows], kind="stable")], []
    left = left[ends.cost[left] < ends.cost[left[0]] + BEHIND_IN_SEARCH]
    while left.size and len(found) < MOST_VALLEYS:
        found.append(int(left[0]))
        left = left[~in_valley(ends, found[-1], left)]
    return found

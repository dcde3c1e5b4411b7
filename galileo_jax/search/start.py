"""A start: where a move proposes to look for a hypothesis."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from galileo_jax.search.hypothesis import Hypothesis


@dataclass(frozen=True, eq=False)
class Start:
    """A place in the space of all parameters from which a hypothesis is searched for.

    Attributes:
      effects: of the hypothesis.
      z: `[model parameter]`, each with a unit normal prior.
      parent: what it was made from, None where nothing was known; with its last effect added, a
        score test says what that effect explains.
      move: name of the move that proposes it.
      rivals: of a move's starts of a hypothesis with the same label only the best is followed.
      is_near: whether it is refined at once: beside a fit a race, which assumes more noise, would
        not tell the valleys apart.
      cost: where a race ended, nats; there `z` is.
      promise: that less what the width of the valley is worth.
      num_agreeing: starts of the race that ended in its valley; 0: there was none.
    """

    effects: tuple[str, ...]
    z: Float[np.ndarray, " parameter"]
    parent: Hypothesis | None
    move: str
    rivals: int = 0
    is_near: bool = False
    cost: float = np.nan
    promise: float = np.nan
    num_agreeing: int = 0

    @property
    def key(self) -> frozenset[str]:
        """The effects in no order."""
        return frozenset(self.effects)

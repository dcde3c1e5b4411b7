"""Which pairs of effects are tried where no single effect explains the data."""

from collections.abc import Collection, Sequence
from itertools import combinations

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.verdict import (
    DECISIVE,
    NUM_CROSSED,
    NUM_JOINED,
    NUM_PAIRS,
    NUM_SWAPPED,
)
from galileo_jax.inference.fits.ends import BEHIND_IN_SEARCH


def pairs_to_try(
    singles: Sequence[Candidate], library: Sequence[str], gains: np.ndarray
) -> list[list[tuple[str, str]]]:
    """The `NUM_PAIRS` pairs that promise most, for each single effect those that begin with it.

    A pair promises the evidence of the single effect and what the other one would add to it. A
    pair that two singles could begin stands with the one from which it promises more.

    Args:
      singles: the best single effects, which others may join.
      library: the effects that may join them.
      gains: `[single, effect]`, nats that each would add, from `score_tests.best_gains`.
    """
    promise = np.array([c.log_evidence for c in singles])[:, None] + gains
    found: dict[frozenset[str], tuple[int, tuple[str, str]]] = {}
    for at in np.argsort(-promise, axis=None):
        i, j = divmod(int(at), len(library))
        (first,), second = singles[i].effects, library[j]
        if first != second and len(found) < NUM_PAIRS:
            found.setdefault(frozenset((first, second)), (i, (first, second)))
    return [[pair for i, pair in found.values() if i == own] for own in range(len(singles))]


def pairs_from_scratch(candidates: Sequence[Candidate]) -> list[tuple[str, ...]]:
    """The best pairs so far, and all that the best single effects make with each other.

    Args:
      candidates: ranked; forms are left out.
    """
    best = [c.effects for c in candidates if len(c.effects) == 2][:NUM_JOINED]
    singles = [c.name for c in candidates if len(c.effects) == 1 and not c.is_form]
    crossed = combinations(singles[:NUM_CROSSED], 2)
    return list({frozenset(pair): pair for pair in (*best, *crossed)}.values())


def not_tried(
    kept: str, library: Sequence[str], tried: Collection[frozenset[str]]
) -> list[tuple[str, str]]:
    """An effect joined with each of the library that it was not tried with."""
    return [
        (kept, name) for name in library if name != kept and frozenset((kept, name)) not in tried
    ]


def crossed_pairs(made: Sequence[Candidate]) -> list[tuple[str, str]]:
    """At most `NUM_PAIRS` that the effects of the best pairs make with each other, not fitted yet.

    Args:
      made: pairs that were fitted, ranked.
    """
    equal = [c for c in made if made[0].log_odds - c.log_odds < DECISIVE]
    names = dict.fromkeys(name for c in equal for name in c.effects)
    known = {frozenset(c.effects) for c in made}
    crossed = [pair for pair in combinations(names, 2) if frozenset(pair) not in known]
    return crossed[:NUM_PAIRS]


def most_alike(costs: np.ndarray, lowest: float) -> np.ndarray:
    """Which pairs come near the best, the nearest first: at most `NUM_SWAPPED`, indices.

    Who is too far behind at the search's noise is farther behind by the clip's own.

    Args:
      costs: `[pair]`, nats, that a short search came to.
      lowest: cost of the best pair so far.
    """
    order = np.argsort(costs, kind="stable")[:NUM_SWAPPED]
    return order[costs[order] < min(lowest, float(costs.min())) + BEHIND_IN_SEARCH]

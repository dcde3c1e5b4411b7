"""Pairs of effects, fitted: where no single effect explains the data."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.diagnosis.candidates import reduced
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.pairs import most_alike, not_tried, pairs_from_scratch, pairs_to_try
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.score_tests import best_gains
from galileo_jax.diagnosis.verdict import NUM_JOINED, ranked


def fitted_pairs(
    race: Race, candidates: Sequence[Candidate], library: Sequence[str]
) -> tuple[Candidate, ...]:
    """Pairs of the best single effects with others, and what could be confused with the best pair.

    The first are fitted from the single effects' fits. One that is as good as the best pair may not
    be reached from there: it is, from the best pair without one of its effects.
    """
    trials, seed = race.fitter.trials, race.seed
    singles = [c for c in candidates if not c.is_form][:NUM_JOINED]
    gains = np.stack(
        [
            best_gains(trials, one.hypothesis.fit, [(*one.effects, name) for name in library], seed)
            for one in singles
        ]
    )
    sets, starts = [], []
    for one, pairs in zip(singles, pairs_to_try(singles, library, gains), strict=True):
        sets += pairs
        starts += [one.hypothesis] * len(pairs)
    if not sets:
        return ()
    made = race(starts, sets)
    best = ranked(made)[0]
    sets, starts = [], []
    for kept in best.effects:
        start = reduced(trials, best.hypothesis, [kept])
        if others := not_tried(kept, library, made):
            gains = best_gains(trials, start.fit, others, seed)
            alike = most_alike(others, gains)
            sets += alike
            starts += [start] * len(alike)
    if sets:
        made += race(starts, sets)
    return ranked(made)


def pairs_from_base(race: Race, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Pairs fitted from the fit without effects: those that come to a better valley, and new ones.

    A single effect's fit bends all else to do what the second one does, and the pair may not be
    reached from there, nor seem to promise much.
    """
    known = {frozenset(c.effects): c for c in candidates}
    sets = pairs_from_scratch(candidates)
    if not sets:  # a library of one effect
        return []
    made = race([race.base] * len(sets), sets)
    olds = [known.get(frozenset(new.effects)) for new in made]
    return [
        new
        for old, new in zip(olds, made, strict=True)
        if old is None or new.log_evidence > old.log_evidence
    ]

"""Pairs of effects, fitted: where no single effect explains the data, or a pair is ahead of it."""

from collections.abc import Sequence
from itertools import combinations

import numpy as np

from galileo_jax.diagnosis.candidates import Hypothesis, reduced
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.pairs import (
    crossed_pairs,
    most_alike,
    not_tried,
    pairs_from_scratch,
    pairs_to_try,
)
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.score_tests import best_gains
from galileo_jax.diagnosis.short_search import short_search
from galileo_jax.diagnosis.verdict import NUM_JOINED, best_named, ranked

PLACE = ("_start", "_length")  # of what acts in one place only
STRENGTHS_Z = (-1.0, 0.0, 1.0, 2.0)
NUM_ROUNDS = 2  # the second where what could be confused with the best pair is better than that


def fitted_pairs(
    race: Race, candidates: Sequence[Candidate], library: Sequence[str]
) -> tuple[Candidate, ...]:
    """Pairs of the best single effects with others, and what could be confused with the best pair.

    The first are fitted from the single effects' fits. One that is as good as the best pair may not
    be reached from there: it is, from the best pair without one of its effects. Not where the best
    pair has less evidence than one of its effects alone: what is like it has no more.
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
    searched = {frozenset(c.effects) for c in made}
    alone = {c.name: c.log_evidence for c in candidates}

    def adds(pair: Candidate) -> bool:
        return pair.log_evidence > max(alone.get(name, -np.inf) for name in pair.effects)

    best = ranked(made)[0]
    stronger = max(best.effects, key=lambda name: alone.get(name, -np.inf))
    taken = best.effects if adds(best) else (stronger,)
    made += _of_others(race, best, taken, candidates, library, searched)
    for _ in range(NUM_ROUNDS):
        best = ranked(made)[0]
        if not adds(best):
            break
        made += _alike(race, best, library, searched)
        if ranked(made)[0].effects == best.effects:
            break
    for _ in range(NUM_ROUNDS):
        best = ranked(made)[0]
        made = best_of_each([*made, *_in_its_place(race, best, library)])
        if ranked(made)[0].effects == best.effects:
            break
    known = {frozenset(c.effects) for c in made}
    return ranked([*made, *_crossed(race, ranked(filter(adds, made)), known)])


def pairs_like_the_best(
    race: Race, candidates: Sequence[Candidate], library: Sequence[str]
) -> list[Candidate]:
    """What could be confused with the pair that leads in the end, fitted; none where none leads.

    It may have been found after `fitted_pairs` looked at what is like its own best, and two
    effects may pass for another two.

    Args:
      race: of the candidates.
      candidates: the table.
      library: names of the effects.
    """
    made: list[Candidate] = []
    searched = {frozenset(c.effects) for c in candidates}
    for _ in range(NUM_ROUNDS):
        best = best_named(ranked([*candidates, *made]))
        if len(best.effects) != 2:
            break
        made += _alike(race, best, library, searched)
        if best_named(ranked([*candidates, *made])).effects == best.effects:
            break
    return made


def _alike(
    race: Race, best: Candidate, library: Sequence[str], searched: set[frozenset[str]]
) -> list[Candidate]:
    """Pairs of either effect of the best pair and one that does what the other does, fitted.

    Which these are a short search for them all tells: without one of its effects the best pair is
    so far from the data that slopes mean nothing there. Those searched for are added to `searched`.
    """
    sets, starts = [], []
    for kept in best.effects:
        others = not_tried(kept, library, searched)
        sets += others
        starts += [reduced(race.fitter.trials, best.hypothesis, [kept])] * len(others)
    searched.update(frozenset(pair) for pair in sets)
    return _nearest(race, best, starts, sets)


def _in_its_place(race: Race, best: Candidate, library: Sequence[str]) -> list[Candidate]:
    """The best pair with another effect of a place where it has one: a brake for a patch, fitted.

    A place is met by few starts. Here it is known, and only the strength is to be found.
    """
    names = [p.name for p in race.fitter.trials.model_parameters]
    sets: list[tuple[str, ...]] = []
    bases, starts = [], []
    for one in best.effects:
        (kept,) = (name for name in best.effects if name != one)
        for other in library:
            same = [(names.index(one + s), other + s) for s in PLACE if one + s in names]
            if other in best.effects or not same or any(name not in names for _, name in same):
                continue
            z = best.hypothesis.fit.z[: len(names)].copy()
            for i, name in same:
                z[names.index(name)] = z[i]
            tried = np.tile(z, (len(STRENGTHS_Z), 1))
            tried[:, names.index(other)] = STRENGTHS_Z
            sets.append((kept, other))
            starts.append(tried)
            bases.append(reduced(race.fitter.trials, best.hypothesis, [kept]))
    return race(bases, sets, starts) if sets else []


def best_of_each(made: Sequence[Candidate]) -> list[Candidate]:
    """Of fits of the same effects the one with the most evidence."""
    found: dict[frozenset[str], Candidate] = {}
    for one in sorted(made, key=lambda c: c.log_evidence):
        found[frozenset(one.effects)] = one
    return list(found.values())


def _of_others(
    race: Race,
    best: Candidate,
    taken: Sequence[str],
    candidates: Sequence[Candidate],
    library: Sequence[str],
    searched: set[frozenset[str]],
) -> list[Candidate]:
    """Pairs of effects that are not `taken`, fitted where a short search comes near the best pair.

    Two effects may together do what the best single effect does alone, and neither of them need be
    among the best. Each pair starts from the better of its single effects. Those fitted are added
    to `searched`.
    """
    singles = sorted((c for c in candidates if c.name in library), key=lambda c: -c.log_evidence)
    pairs = [(one, (one.name, other.name)) for one, other in combinations(singles, 2)]
    left = [
        (one, pair)
        for one, pair in pairs
        if frozenset(pair) not in searched and not set(pair) & set(taken)
    ]
    made = _nearest(race, best, [one.hypothesis for one, _ in left], [pair for _, pair in left])
    searched.update(frozenset(c.effects) for c in made)
    return made


def _crossed(race: Race, made: Sequence[Candidate], known: set[frozenset[str]]) -> list[Candidate]:
    """What the effects of the pairs that are about equal make with each other, fitted.

    Where A and B do as well as A and C and as D and C, so may B and C, with all else so different
    that from any of them only side valleys are reached: each is searched for from scratch.

    Args:
      race: of the candidates.
      made: pairs that have more evidence than either effect alone, ranked.
      known: all pairs that were fitted.
    """
    sets = [pair for pair in crossed_pairs(made) if frozenset(pair) not in known]
    if not sets:
        return []
    count = len(race.fitter.trials.model_parameters)
    starts = [race.fitter.fit(race.seed, effects=pair).z[None, :count] for pair in sets]
    return race([race.base] * len(sets), sets, starts)


def _nearest(
    race: Race, best: Candidate, starts: Sequence[Hypothesis], sets: Sequence[tuple[str, str]]
) -> list[Candidate]:
    """Of pairs those that a short search brings near the best one so far, fitted."""
    if not sets:
        return []
    fitter = race.fitter
    fit, count = best.hypothesis.fit, len(fitter.trials.model_parameters)
    lowest = float(fitter.search_costs(fit.z[None, :count], fit.free[None, :count])[0])
    z, costs = short_search(fitter, [one.fit for one in starts], sets, race.seed, lowest)
    near = most_alike(costs, lowest)
    if not near.size:
        return []
    return race([starts[i] for i in near], [sets[i] for i in near], list(z[near, None]))


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

"""Whether two effects say as well what one effect explains alone.

Two effects may pass for one: a force and another friction of the second surface move the objects as
a wrong frame rate does. And a comparison that looks for any misfit overlooks a small one of a known
shape: a frame rate that is wrong by 7 % beside a strip of friction left p = 0.03, and was 17 nats
of evidence. Slopes beside the single effect may show neither: all else has moved to make up for
what is missing. So before one effect is named, all pairs of the library are searched for, shortly;
what comes near is refined roughly; and what may contest the name is fitted with care.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import exp

import numpy as np

from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.candidates import MAY_STILL_GAIN, Hypothesis
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.short_search import short_search
from galileo_jax.diagnosis.verdict import DECISIVE, NUM_SWAPPED, best_named
from galileo_jax.inference.fits.ends import BEHIND_IN_SEARCH

NUM_AT_ONCE = 8  # refined in one batch
MOST_OTHERS = 16  # pairs without the best single effect that are refined, those that come nearest
ROUGH_NATS = 1.0  # by which log odds may be too low, where a pair was refined roughly
# The probability from which on it is said that something else may be there beside what is named.
WORTH_SAYING = 0.1


@dataclass(frozen=True)
class NearPair:
    """A pair that comes near a single effect.

    Attributes:
      hypothesis: refined roughly.
      log_odds: over the model without effects, nats; by Laplace, and as much too low or too high by
        that as the single effect's.
    """

    hypothesis: Hypothesis
    log_odds: float

    @property
    def effects(self) -> tuple[str, ...]:
        """Their names."""
        return self.hypothesis.effects


def pairs_near(
    race: Race, candidates: Sequence[Candidate], library: Sequence[str], decisive: float
) -> list[NearPair]:
    """Pairs that a short search of all brings near the best single effect, refined roughly.

    Args:
      race: of the candidates.
      candidates: ranked, single effects.
      library: names of the effects.
      decisive: nats by which a rival must be behind.

    Returns:
      The most probable first.
    """
    singles = sorted((c for c in candidates if c.name in library), key=lambda c: -c.log_evidence)
    pairs = [(one.name, other.name) for one, other in combinations(singles, 2)]
    if not pairs:
        return []
    best, count = best_named(candidates), len(race.fitter.trials.model_parameters)
    fit, alone = best.hypothesis.fit, {c.name: c.hypothesis.fit for c in singles}
    lowest = float(race.fitter.search_costs(fit.z[None, :count], fit.free[None, :count])[0])
    bases = [alone[first] for first, _ in pairs]
    z, costs = short_search(race.fitter, bases, pairs, race.seed, lowest, most=len(pairs))
    near = np.flatnonzero(costs < min(lowest, float(costs.min())) + BEHIND_IN_SEARCH)
    near = near[np.argsort(costs[near], kind="stable")]
    has_best = np.array([best.name in pairs[i] for i in near], bool)
    near = near[has_best | (np.cumsum(~has_best) <= MOST_OTHERS)]
    # Like with like: the single effect's evidence may have been mended.
    error = best.log_odds - race.log_odds(Hypothesis(best.effects, fit))
    found = _best_first(_refined(race, [(pairs[i], z[i]) for i in near], error))
    least = best.log_odds - decisive - MAY_STILL_GAIN
    some = [pair.hypothesis for pair in found if pair.log_odds > least][:NUM_SWAPPED]
    variants = [(one.effects, z) for one in some for z in race.fitter.with_variants(one.fit)[1:]]
    return _best_first([*found, *_refined(race, variants, error)])


def contesting_pairs(
    race: Race, candidates: Sequence[Candidate], near: Sequence[NearPair], decisive: float
) -> list[Candidate]:
    """Of pairs those that may contest the best single effect, fitted with care.

    Args:
      race: of the candidates.
      candidates: ranked, single effects.
      near: what `pairs_near` found.
      decisive: nats by which a rival must be behind.
    """
    least = best_named(candidates).log_odds - decisive - ROUGH_NATS
    some = [pair.hypothesis for pair in near if pair.log_odds > least][:NUM_SWAPPED]
    if not some:
        return []
    count = len(race.fitter.trials.model_parameters)
    alone = {c.name: c.hypothesis for c in candidates if len(c.effects) == 1}
    bases = [alone[one.effects[0]] for one in some]
    return race(bases, [one.effects for one in some], [one.fit.z[None, :count] for one in some])


def _refined(
    race: Race, starts: Sequence[tuple[tuple[str, ...], np.ndarray]], error: float
) -> list[NearPair]:
    """Pairs refined roughly from `(effects, z)`, a few at once; without those far behind.

    `error`: nats by which Laplace's evidence is too low; it is added.
    """
    if not starts:
        return []
    trials, count = race.fitter.trials, len(race.fitter.trials.model_parameters)
    free = np.stack([trials.free(effects)[:count] for effects, _ in starts])
    parts = np.split(np.arange(len(starts)), range(NUM_AT_ONCE, len(starts), NUM_AT_ONCE))
    fits = race.fitter.polish_in_turn(np.stack([z for _, z in starts]), free, parts)
    found = [Hypothesis(starts[i][0], fit) for i, fit in fits]
    return [NearPair(one, race.log_odds(one) + error) for one in found]


def _best_first(pairs: Sequence[NearPair]) -> list[NearPair]:
    """Of each pair the most probable fit, the most probable pair first."""
    best = {pair.effects: pair for pair in sorted(pairs, key=lambda pair: pair.log_odds)}
    return sorted(best.values(), key=lambda pair: -pair.log_odds)


def shares_of_seconds(
    named: Candidate, candidates: Sequence[Candidate], near: Sequence[NearPair]
) -> dict[str, float]:
    """The probability of each other effect that it is there beside a named one, as far as is known.

    Args:
      named: a single effect.
      candidates: all that were fitted with care.
      near: pairs that were refined roughly.
    """
    fitted = [c for c in candidates if len(c.effects) == 2 and not c.is_form]
    over_named = {
        other: pair.log_odds - named.log_odds
        for pair in (*near, *fitted)  # what was fitted with care counts
        if named.name in pair.effects
        for other in set(pair.effects) - {named.name}
    }
    weights = {name: exp(min(nats, DECISIVE)) for name, nats in over_named.items()}
    total = 1.0 + sum(weights.values())
    return {name: weight / total for name, weight in weights.items()}


def with_second(
    verdict: Verdict, candidates: Sequence[Candidate], near: Sequence[NearPair]
) -> Verdict:
    """The verdict; of a single effect that is named, with how probable a second one is."""
    if verdict.status != "named" or len(verdict.effects) != 1:
        return verdict
    named = next(c for c in candidates if c.effects == verdict.effects)
    shares = shares_of_seconds(named, candidates, near)
    if sum(shares.values()) < WORTH_SAYING:
        return verdict
    why = reasons.second_possible(named, shares)
    return replace(verdict, reasons=(*verdict.reasons, why))

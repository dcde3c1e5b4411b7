"""Whether a second effect is there as well, where one effect explains the data already.

A comparison that looks for any misfit overlooks a small one of a known shape: a frame rate that is
wrong by 7 % beside a strip of friction left p = 0.03, and was 17 nats of evidence. Pairs are tried
where a second effect promises more than it costs; what promises less may be there unseen, and how
probable that is, is said beside the name.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import exp

from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Candidate, Promise, Verdict
from galileo_jax.diagnosis.race import Race
from galileo_jax.diagnosis.score_tests import promised_evidence
from galileo_jax.diagnosis.verdict import DECISIVE, NUM_JOINED, best_named, log_prior

# Nats by which slopes may promise too little: they promised 1.1 and 4.1 of what were 2.3 and 4.7.
SLOPE_NATS = 0.5
# The probability from which on it is said that something else may be there beside what is named.
WORTH_SAYING = 0.1


def promises_of_seconds(
    race: Race, candidates: Sequence[Candidate], library: Sequence[str]
) -> list[Promise]:
    """What every effect promises beside each of the best ones.

    Args:
      race: of the candidates.
      candidates: ranked, single effects.
      library: names of the effects.
    """
    if len(library) < 2:
        return []
    best = best_named(candidates)
    one, two = (log_prior([1.0] * count, len(library)) for count in (1, 2))
    promises = []
    for first in [c for c in candidates if c.name in library][:NUM_JOINED]:
        others = [name for name in library if name not in first.effects]
        if others:
            pairs = [(*first.effects, name) for name in others]
            fit = first.hypothesis.fit
            evidence = promised_evidence(race.fitter.trials, fit, pairs, race.seed)
            behind = best.log_evidence - first.log_evidence
            promises += [
                Promise(first.name, other, float(own) - behind, one - two, float(own))
                for other, own in zip(others, evidence, strict=True)
            ]
    return promises


def promised_by_a_second(promises: Sequence[Promise]) -> Promise | None:
    """The effect that promises most beside one of the best; None if none promises enough.

    Enough is more evidence, and so much that the pair would be less than `DECISIVE` nats behind the
    single effect: it might contest the name.
    """
    if not promises:
        return None
    found = max(promises, key=lambda promise: promise.nats)
    least = max(found.price - DECISIVE - SLOPE_NATS, 0.0)
    return found if found.nats > least else None


def shares_of_seconds(
    named: Candidate, candidates: Sequence[Candidate], promises: Sequence[Promise]
) -> dict[str, float]:
    """The probability of each other effect that it is there beside a named one, as far as is known.

    Of a pair that was fitted by its log odds; of another by what its slope promises.

    Args:
      named: a single effect.
      candidates: all that were fitted.
      promises: of seconds beside the best effects.
    """
    over_named = {p.effect: p.gain - p.price for p in promises if p.beside == named.name}
    for c in candidates:
        if len(c.effects) == 2 and named.name in c.effects and not c.is_form:
            (other,) = set(c.effects) - {named.name}
            over_named[other] = c.log_odds - named.log_odds
    weights = {name: exp(min(nats, DECISIVE)) for name, nats in over_named.items()}
    total = 1.0 + sum(weights.values())
    return {name: weight / total for name, weight in weights.items()}


def with_second(
    verdict: Verdict, candidates: Sequence[Candidate], promises: Sequence[Promise]
) -> Verdict:
    """The verdict; of a single effect that is named, with how probable a second one is."""
    if verdict.status != "named" or len(verdict.effects) != 1:
        return verdict
    named = next(c for c in candidates if c.effects == verdict.effects)
    shares = shares_of_seconds(named, candidates, promises)
    if sum(shares.values()) < WORTH_SAYING:
        return verdict
    why = reasons.second_possible(named, shares)
    return replace(verdict, reasons=(*verdict.reasons, why))

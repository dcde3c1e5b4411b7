"""How probable a second effect is beside one that is named."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp

from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.diagnosis.verdict import DECISIVE

# The probability from which on it is said that something else may be there beside what is named.
WORTH_SAYING = 0.1


def shares_of_seconds(
    named: Candidate, log_odds: Mapping[frozenset[str], float]
) -> dict[str, float]:
    """The probability of each other effect that it is there beside a named one, as far as is known.

    Args:
      named: a single effect.
      log_odds: of all that was fitted, over the model without effects, nats.
    """
    over_named = {
        other: nats - named.log_odds
        for key, nats in log_odds.items()
        if len(key) == 2
        for other in sorted(key - {named.name})
        if named.name in key
    }
    weights = {name: exp(min(nats, DECISIVE)) for name, nats in over_named.items()}
    total = 1.0 + sum(weights.values())
    return {name: weight / total for name, weight in weights.items()}


def with_second(
    verdict: Verdict, candidates: Sequence[Candidate], log_odds: Mapping[frozenset[str], float]
) -> Verdict:
    """The verdict; of a single effect that is named, with how probable a second one is."""
    if verdict.status != "named" or len(verdict.effects) != 1:
        return verdict
    named = next(c for c in candidates if c.effects == verdict.effects)
    shares = shares_of_seconds(named, log_odds)
    if sum(shares.values()) < WORTH_SAYING:
        return verdict
    why = reasons.second_possible(named, shares)
    return replace(verdict, reasons=(*verdict.reasons, why))

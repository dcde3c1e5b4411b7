"""What is said beside a name: of a constant that it takes for known, and of a second effect.

Linear drag is a drag with the power 1 of the speed. Where a clip hardly tells the power, the name
rests on what was believed before: most drags have a power with a name. Then that is said, too.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import exp

import numpy as np

from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.diagnosis.reasons import because
from galileo_jax.diagnosis.thresholds import DECISIVE, WORTH_SAYING
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.forms import FORMS

INTERVAL = (0.025, 0.975)  # 95 %


def with_known_constants(
    trials: JointProblem, verdict: Verdict, candidates: Sequence[Candidate], seed: int
) -> Verdict:
    """A named verdict with what the data alone say of the constant that its name takes for known.

    Others than named stay as they are, and so do pairs.
    """
    if verdict.status != "named" or len(verdict.effects) != 1:
        return verdict
    table = {c.name: c for c in candidates}
    named, said = table.get(verdict.effects[0]), []
    for form in FORMS:
        rival = table.get(form.name)
        if named is None or rival is None or named.name not in form.named_values:
            continue
        if named.log_evidence - rival.log_evidence < DECISIVE:
            draws = fit_posterior(rival.hypothesis.of(trials), rival.hypothesis.fit, seed)
            low, high = np.quantile(draws[f"{form.name}_{form.constant}"], INTERVAL).tolist()
            numbers = {"value": form.named_values[named.name], "low": low, "high": high}
            words = {"constant": form.constant_words}
            said.append(because("constant_by_data", named, words=words, form=form.name, **numbers))
    return replace(verdict, reasons=(*verdict.reasons, *said))


def shares_of_seconds(
    named: Candidate, log_odds: Mapping[frozenset[str], float]
) -> dict[str, float]:
    """The probability of each other effect that it is there beside a named one, as far as is known.

    `log_odds` are those of all that was fitted, over the model without effects, nats.
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
    total = sum(shares.values())
    if total < WORTH_SAYING:
        return verdict
    second = max(shares, key=lambda name: shares[name])
    numbers = {"probability": total, "probability_of_second": shares[second]}
    why = because("second_possible", named, second=second, **numbers)
    return replace(verdict, reasons=(*verdict.reasons, why))

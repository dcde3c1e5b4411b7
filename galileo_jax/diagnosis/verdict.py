"""The rules by which candidates become a verdict: which explain the data, and which one is named.

A candidate is judged by two numbers. Its log evidence (Laplace, in nats, over the model without
any effect) ranks it among the others; the p-value of its comparison with the data says whether
what it leaves unexplained is more than noise. The rules need no trials and no fit, so that each
can be tested with candidates made by hand. Every threshold of the diagnosis stands here.
"""

from collections.abc import Sequence

import numpy as np

from galileo_jax.comparison.compare import ADEQUATE_P
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict

# Difference in log evidence, in nats, at which the weaker of two candidates is given up: it is
# then twenty times less probable (e^3 = 20).
DECISIVE = 3.0
# How much wider that margin is where the base model already passes its comparison: the effect is
# then so faint that more candidates stay possible.
FAINT_FACTOR = 2.0
# Log evidence, in nats, at which an effect is believed although the base model passes its
# comparison: a test that looks everywhere notices less than one that knows where to look.
CONVINCING = 10.0
# A candidate explains the data if its comparison has at least this p-value. It is far below
# ADEQUATE_P because a camera that measures hundredths of a pixel finds fault with every model...
EXPLAINS_P = 1e-5
# ... or, whatever its p-value, if it leaves less than this share of the base model's misfit.
LEFT_SHARE = 0.01
# Two effects together can come close to almost any motion: a pair must pass this p-value.
PAIR_P = 0.05
# Gain in log evidence, in nats, for which an effect is worth adding: to the best single effect
# for a pair, to the base model where the verdict is unknown and the best guess is shown.
LEAST_GAIN = 10.0
# Probability before the data that nothing is missing; all candidates share the rest equally.
PRIOR_NONE = 0.5
# Comparing costs two hundred replicates for each candidate: only so many of the best are compared.
NUM_COMPARED = 6
# The best single effect is tried together with so many others: those with the largest scores.
NUM_JOINED = 8

UNKNOWN = Verdict("unknown", ())


def probabilities(log_evidence: np.ndarray) -> np.ndarray:
    """Posterior probabilities of the candidates; what is missing to 1 is that of none of them.

    Args:
      log_evidence: `[candidate]`, nats, over the model without an effect.

    Returns:
      `[candidate]`.
    """
    weight = np.append(
        log_evidence + np.log((1 - PRIOR_NONE) / len(log_evidence)), np.log(PRIOR_NONE)
    )
    weight = np.exp(weight - weight.max())
    return (weight / weight.sum())[:-1]


def is_nothing_missing(is_base_adequate: bool, candidates: Sequence[Candidate]) -> bool:
    """Whether the verdict is none: the base model is adequate and no named effect convinces.

    Args:
      is_base_adequate: whether the model without effects passes its comparison with the data.
      candidates: ranked, the best first; forms without a name do not count.
    """
    return is_base_adequate and best_named(candidates).log_evidence < CONVINCING


def decisive_margin(is_base_adequate: bool) -> float:
    """The difference in log evidence, nats, at which one candidate rules out another."""
    return DECISIVE * (FAINT_FACTOR if is_base_adequate else 1.0)


def best_named(candidates: Sequence[Candidate]) -> Candidate:
    """The first candidate that is no form without a name; candidates are ranked."""
    return next(c for c in candidates if not c.is_form)


def to_compare(candidates: Sequence[Candidate]) -> tuple[Candidate, ...]:
    """The candidates whose fits are to be compared with the data, the best first.

    Always the best, and the best with a name; beyond these only what could be confused with the
    best: within the widest margin of it and among the first `NUM_COMPARED`.

    Args:
      candidates: ranked by log evidence, the best first.
    """
    best = candidates[0]
    always = {best.effects, *[c.effects for c in candidates if not c.is_form][:1]}
    widest = FAINT_FACTOR * DECISIVE
    return tuple(
        c
        for i, c in enumerate(candidates)
        if c.effects in always or (i < NUM_COMPARED and best.log_evidence - c.log_evidence < widest)
    )


def rivals(candidate: Candidate, all_of: Sequence[Candidate]) -> tuple[str, ...]:
    """Names of the compared candidates whose evidence is as good as this one's.

    Symmetric: a rival's rivals include the candidate. Empty where it was not compared itself.
    """
    if candidate.p_value is None:
        return ()
    return tuple(
        other.name
        for other in all_of
        if other.effects != candidate.effects
        and other.p_value is not None
        and abs(other.log_evidence - candidate.log_evidence) < DECISIVE
    )


def explains(candidate: Candidate, base_misfit: float) -> bool:
    """Whether a candidate explains the data: what it leaves unexplained does not matter.

    Args:
      candidate: compared with the data; one that was not is no explanation.
      base_misfit: `Hypothesis.misfit` of the model without effects.
    """
    if candidate.p_value is None:
        return False
    if candidate.p_value >= EXPLAINS_P:
        return True
    return base_misfit > 0 and candidate.hypothesis.misfit < LEFT_SHARE * base_misfit


def verdict_of(
    candidates: Sequence[Candidate], base_misfit: float, decisive: float
) -> Verdict | None:
    """The verdict on ranked candidates, without advice.

    Args:
      candidates: ranked by log evidence, the best first; those compared have a p-value.
      base_misfit: `Hypothesis.misfit` of the model without effects.
      decisive: difference in log evidence, nats, at which one candidate rules out another.

    Returns:
      Named: one effect explains the data and nothing else explains them as well. Ambiguous:
      several do; a form without a name stands last. Unknown: only a form does. None: nothing
      does, or what does is far behind an effect that does not.
    """
    if candidates[0].log_evidence < 0:
        return None
    compared = [c for c in candidates if c.p_value is not None]
    names = [c for c in compared if not c.is_form and explains(c, base_misfit)]
    # A form can adapt to much. One that leaves a misfit, as where two simulators differ by a
    # little, is no explanation: it must be adequate, with no allowance.
    forms = [c for c in compared if c.is_form and (c.p_value or 0.0) >= ADEQUATE_P]
    top = max((c.log_evidence for c in names), default=-np.inf)
    if forms and forms[0].log_evidence - top > decisive:
        return Verdict("unknown", (), forms[0].name)
    best = max((c.log_evidence for c in candidates if not c.is_form), default=-np.inf)
    if not names or best - top > decisive:
        return None
    equal = [c for c in names if top - c.log_evidence < decisive]
    alike = [c.name for c in forms if abs(top - c.log_evidence) < decisive]
    if len(equal) == 1 and not alike:
        return Verdict("named", equal[0].effects)
    return Verdict("ambiguous", (*[c.name for c in equal], *alike[:1]))


def verdict_of_pairs(
    pairs: Sequence[Candidate], best_single: Candidate, base_misfit: float, decisive: float
) -> Verdict:
    """The verdict where no single effect explains the data: on pairs, or unknown.

    Args:
      pairs: ranked by log evidence, the best first; may be empty.
      best_single: the best effect alone, which all pairs contain.
      base_misfit: `Hypothesis.misfit` of the model without effects.
      decisive: difference in log evidence, nats, at which one candidate rules out another.
    """
    if not pairs:
        return UNKNOWN
    best = pairs[0]
    helps = best.log_evidence - best_single.log_evidence > LEAST_GAIN
    is_clean = (best.p_value or 0.0) >= PAIR_P
    verdict = verdict_of(pairs, base_misfit, decisive) if helps and is_clean else None
    return verdict or UNKNOWN


def to_add(verdict: Verdict, candidates: Sequence[Candidate]) -> Candidate | None:
    """The candidate that the loop adds to the model; None where nothing helps enough.

    The one that is named; of several that explain the data as well, the first. Where the verdict
    is unknown, the best named effect is shown if it helps, though it does not explain the data.

    Args:
      verdict: not none.
      candidates: those that the verdict is on, ranked, before any others.
    """
    if verdict.status == "unknown":
        best = best_named(candidates)
        return best if best.log_evidence > LEAST_GAIN else None
    names = ("+".join(verdict.effects), verdict.effects[0])
    return next(c for c in candidates if c.name in names)

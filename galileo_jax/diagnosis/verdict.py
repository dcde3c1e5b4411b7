"""The rules by which candidates become a verdict: which explain the data, and which one is named.

A hypothesis is judged by two numbers. Its log odds (log evidence by Laplace plus log prior, in
nats, over the model without any effect) rank it among all others; the p-value of its comparison
with the data says whether what it leaves unexplained is more than noise. The rules need no trials
and no fit, so that each can be tested with candidates made by hand. Every rule says in the
verdict's reasons why it fired; the numbers that decide are in `thresholds`.

Candidates are `ranked`, those near the first compared with the data (`to_compare`); `decisive` is
the difference in log odds, nats, at which one hypothesis rules out another.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from math import sqrt

import numpy as np
from scipy.special import softmax

from galileo_jax.comparison.compare import ADEQUATE_P, Comparison
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Candidate, Reason, Verdict
from galileo_jax.diagnosis.reasons import because
from galileo_jax.diagnosis.thresholds import (
    CONVINCING,
    DECISIVE,
    LEAST_GAIN,
    MOST_LUCK,
    PAIR_P,
    SUBSTANTIAL,
)

# Imperfections that have the name of an effect where they are larger than usual.
AS_EFFECTS: dict[tuple[str, ...], str] = {("friction_roughness",): "uneven_friction"}
UNEVEN = tuple((name,) for name in AS_EFFECTS.values())


def ranked(candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """One table of all hypotheses, the most probable first, with their probabilities.

    These and that of none (`Diagnosis.probability_none`) sum to 1.
    """
    best_first = sorted(candidates, key=lambda c: -c.log_odds)
    shares = softmax([*(c.log_odds for c in best_first), 0.0])[:-1]
    return tuple(replace(c, probability=float(p)) for c, p in zip(best_first, shares, strict=True))


def is_nothing_missing(is_base_accepted: bool, candidates: Sequence[Candidate]) -> bool:
    """Whether the verdict is none: the base model will do and no named effect convinces."""
    return is_base_accepted and best_named(candidates).log_odds < CONVINCING


def without_a_name(
    comparison: Comparison, candidates: Sequence[Candidate], is_friction: bool = True
) -> Verdict | None:
    """The verdict where no effect is needed in an imperfect world; None where one is.

    None is missing where imperfections of usual sizes leave nothing but noise and no effect beside
    them is ahead by `DECISIVE`: the exact model was contradicted, and that sizes found in the data
    leave only noise speaks less for it than a test that it passes without them (`CONVINCING`). A
    form without a name, which stands for anything smooth, as imperfections do, has to convince. The
    friction is uneven where it varies by more and no effect, with imperfections of usual sizes,
    explains the data about as well; ambiguous where one does. A formula has to be better than
    imperfections are. What would have to push is no friction.

    `comparison`: of the model without effects; it and the candidates are with imperfections.
    `is_friction`: whether uneven friction is nowhere negative.
    """
    if comparison.p_value < ADEQUATE_P:
        return None
    explaining = [c for c in candidates if explains(c)]
    if any(c.log_odds >= (CONVINCING if c.is_form else DECISIVE) for c in explaining):
        return None
    why = (reasons.imperfections_explain(comparison, DECISIVE),)
    form = next((c for c in explaining if c.is_form and c.log_odds >= DECISIVE), None)
    if form is not None:
        why = (*why, because("form_beside", form, least_log_odds=CONVINCING))
    if not comparison.unusual:
        return Verdict("none", (), reasons=why)
    name = AS_EFFECTS.get(comparison.unusual)
    if name is None or not is_friction:
        return None
    rivals = [c for c in explaining if not c.is_form and c.law is None and c.log_odds > -DECISIVE]
    if not rivals:
        return Verdict("named", (name,), reasons=why)
    because_of_both = (because("explains", rivals[0]), *why)
    return Verdict("ambiguous", (rivals[0].name, name), reasons=because_of_both)


def best_named(candidates: Sequence[Candidate]) -> Candidate:
    """The first of ranked candidates that is neither a form without a name nor a law."""
    return next(c for c in candidates if not c.is_form and c.law is None)


def to_compare(candidates: Sequence[Candidate], margin: float) -> tuple[Candidate, ...]:
    """The candidates whose fits are to be compared with the data, the best first.

    Always the best, the best with a name and the best formula; beyond these what could be confused
    with the best, alone or together: all others together come to less than a twentieth of it; and
    what the data themselves hardly tell from it. Where the best is a form that says the same as the
    best formula, beyond it what could be confused with the formula.
    """
    best = candidates[0]
    law = next((c for c in candidates if c.law is not None), None)
    leaders = [best]
    if law is not None and best.is_form and best.family == law.family:
        leaders.append(law)
    in_sum = [c for leader in leaders for c in _in_sum(leader, candidates)]
    same = _same_by_data(best, candidates)
    always = [id(c) for c in (best, best_named(candidates), law, *in_sum, *same)]
    return tuple(
        c
        for c in candidates
        if id(c) in always or any(one.log_odds - c.log_odds < margin for one in leaders)
    )


def _in_sum(best: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """As few that may contest the best as must be looked at: the others together are given up."""
    others = _without(best, candidates)
    return [c for i, c in enumerate(others) if best.log_odds - _sum_of(others[i:]) < DECISIVE]


def _without(best: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Hypotheses by which not all of the best one's effects are there."""
    return [c for c in candidates if not set(best.effects) <= set(c.effects)]


def _same_by_data(best: Candidate, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Hypotheses that the data themselves hardly tell from the best, of the table without laws.

    None where the clip leads to expect an effect: that a ball is slowed down by the air needs no
    proof against a drag of any other power.
    """
    if best.law is not None or best.num_expected:
        return []
    others = [c for c in _without(best, candidates) if c.law is None]
    return [c for c in others if best.log_evidence - c.log_evidence < SUBSTANTIAL]


def _sum_of(candidates: Sequence[Candidate]) -> float:
    """Log odds of several hypotheses together."""
    return float(np.logaddexp.reduce([c.log_odds for c in candidates]))


def rivals(candidate: Candidate, all_of: Sequence[Candidate]) -> tuple[str, ...]:
    """Names of the compared candidates whose log odds are as good as this one's.

    Symmetric: a rival's rivals include the candidate. Empty where it was not compared itself.
    """
    if candidate.p_value is None:
        return ()
    return tuple(
        other.name
        for other in all_of
        if other.effects != candidate.effects
        and other.p_value is not None
        and abs(other.log_odds - candidate.log_odds) < DECISIVE
    )


def explains(candidate: Candidate) -> bool:
    """Whether a candidate was compared with the data and leaves nothing but what is usual."""
    is_enough = candidate.p_value is not None and candidate.p_value >= _least_p(candidate)
    return is_enough and not candidate.unusual


def _least_p(candidate: Candidate) -> float:
    """The p-value from which on a hypothesis explains the data."""
    num_surprising = len(candidate.effects) - candidate.num_expected
    return ADEQUATE_P if num_surprising <= 1 else PAIR_P


def _explaining(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Ranked candidates that explain the data, and pairs that only the stricter p-value keeps out.

    Where a less probable pair of effects passes it, one that is no less adequate than a single
    effect must be does so, too.
    """
    top = next((c for c in candidates if explains(c)), None)
    if top is None:
        return []
    leads = [
        c
        for c in candidates[: candidates.index(top)]
        if c.p_value is not None and c.p_value >= ADEQUATE_P and len(c.effects) == len(top.effects)
    ]
    return [c for c in candidates if c in leads or explains(c)]


def pair_ahead_of_all(candidates: Sequence[Candidate], decisive: float) -> Candidate | None:
    """A pair that only its stricter p-value keeps from being named, where formulas were tried.

    All other hypotheses together, formulas and forms among them, are behind it by what a name
    needs, whether the data contradict them or not.
    """
    best = candidates[0]
    is_pair = len(best.effects) > 1 and not best.is_form
    if not is_pair or best.p_value is None or not ADEQUATE_P <= best.p_value < _least_p(best):
        return None
    others = _without(best, candidates)
    return best if not others or best.log_odds - _sum_of(others) >= decisive else None


def form_that_leads(singles: Sequence[Candidate]) -> Candidate | None:
    """The form that explains the data better than any single effect with a name, if one does."""
    best = best_named(singles)
    ahead = [c for c in singles if c.is_form and c.log_odds > best.log_odds and explains(c)]
    return ahead[0] if ahead else None


def needs_pairs(singles: Sequence[Candidate]) -> bool:
    """Whether pairs are to be tried: a single effect leaves more than noise, or a form leads."""
    return not explains(best_named(singles)) or form_that_leads(singles) is not None


def verdict_of(candidates: Sequence[Candidate], decisive: float) -> Verdict:
    """The verdict on the whole table, without advice.

    Named: one hypothesis explains the data, and nothing else does about as well, nor all others
    together, nor does it owe that to its prior alone. Ambiguous: several do; a form without a name
    stands last, and an effect that explains the data alone is not repeated with others. Unknown:
    only a form does, or nothing, or what does is far behind what does not.
    """
    best, explaining = candidates[0], _explaining(candidates)
    if not explaining:
        return _unknown(because("nothing_explains", best))
    top = explaining[0]
    if best.log_odds - top.log_odds >= decisive:
        return _unknown(contradicted(best, top))
    if top.log_odds < 0:
        return _unknown(because("less_probable_than_none", top, log_odds=top.log_odds))
    equal = [c for c in explaining if top.log_odds - c.log_odds < decisive]
    names, forms = [c for c in equal if not c.is_form], [c for c in equal if c.is_form]
    if not names:
        name = next((c for c in explaining if not c.is_form), None)
        only = because("only_a_form", top, p_value=top.p_value)
        return _unknown(because("only_a_form:name", top, name) if name else only, forms[0].name)
    why = because("explains", names[0])
    possible = [c for c in candidates if c.p_value is None or c in explaining]
    if len(equal) == 1:
        if together := [c for c in _in_sum(top, possible) if c in explaining]:
            numbers = {
                "log_odds_behind": top.log_odds - _sum_of(_without(top, possible)),
                "least_log_odds": DECISIVE,
            }
            words = {"others": ", ".join(c.title for c in together)}
            because_all = because("contested_together", top, together[0], words, **numbers)
            return _ambiguous(_with_rivals(top, together), why, because_all)
        if same := [c for c in _same_by_data(top, possible) if c in explaining]:
            alike = _with_rivals(top, same)
            by_prior = (
                because("separated_by_prior", top, rival, least_log_evidence=SUBSTANTIAL)
                for rival in alike[1:]
            )
            return _ambiguous(alike, why, *by_prior)
        behind = [c for c in candidates if c in possible or top.log_odds - c.log_odds >= decisive]
        lead = reasons.decisive(top, behind, decisive)
        return Verdict("named", top.effects, reasons=(why, *_out_of_the_race(best, top), lead))
    alike = [*_without_more(names), *forms[:1]]
    if len(alike) == 1:
        alike = names
    contests = (reasons.contested(names[0], rival, decisive) for rival in alike[1:])
    return _ambiguous(alike, why, *contests)


def _unknown(why: Reason, form: str | None = None) -> Verdict:
    return Verdict("unknown", (), form, reasons=(why,))


def _ambiguous(alike: Sequence[Candidate], *why: Reason) -> Verdict:
    return Verdict("ambiguous", tuple(c.name for c in alike), reasons=why)


def contradicted(better: Candidate, best: Candidate) -> Reason:
    """That what the data contradict is far more probable than the best that explains them."""
    ahead = better.log_odds - best.log_odds
    numbers = {"log_odds_behind": ahead, "p_value": better.p_value}
    return because("better_but_contradicted", best, better, **numbers)


def _out_of_the_race(better: Candidate, best: Candidate) -> tuple[Reason, ...]:
    """That what the data contradict is a little more probable; empty where it is the best."""
    if better is best:
        return ()
    numbers = {"p_value": better.p_value, "least_p_value": _least_p(better)}
    return (because("out_of_the_race", best, better, **numbers),)


def _with_rivals(top: Candidate, rivals: Sequence[Candidate]) -> list[Candidate]:
    """What an ambiguous verdict lists: the best, its rivals with a name, and the best form."""
    named, forms = [[c for c in rivals if c.is_form is it] for it in (False, True)]
    return [top, *_without_more(named), *forms[:1]]


def _without_more(names: Sequence[Candidate]) -> list[Candidate]:
    """Ranked hypotheses without those that add to a more probable one an effect that it needs not.

    Beside every effect that explains the data stand its pairs with whatever does nothing here. One
    with more evidence stays: only what was believed before the data speaks against it.
    """
    return [
        c
        for i, c in enumerate(names)
        if not any(
            set(other.effects) < set(c.effects) and c.log_evidence <= other.log_evidence
            for other in names[:i]
        )
    ]


def within_luck(
    named: Candidate, candidates: Sequence[Candidate], decisive: float
) -> list[Candidate]:
    """The confusables of a named hypothesis: those that only luck may have put behind it.

    Luck is this clip's noise: with another, a rival that the data do not contradict and that is
    not too far behind might be as good. Which these are depends on the clip, not on a list.
    """
    return [
        c
        for c in candidates
        if c.effects != named.effects
        and (c.p_value is None or explains(c))
        and named.log_odds - c.log_odds < farthest(decisive)
    ]


def farthest(decisive: float) -> float:
    """How far behind, in nats, a hypothesis may be only by bad luck."""
    return decisive + MOST_LUCK * sqrt(2 * decisive)


def looked_at_again(
    verdict: Verdict, named: Candidate, expected: Sequence[tuple[Candidate, float]], decisive: float
) -> Verdict:
    """A named verdict, or ambiguous where a clip like this one does not tell a confusable from it.

    `expected`: the confusables, and by how many nats each is behind in a clip like this one, if
    what is named is there.
    """
    looks = tuple(reasons.told_apart(named, rival, by, decisive) for rival, by in expected)
    alike = [rival for rival, by in expected if by < decisive]
    why = (*verdict.reasons, *looks)
    if not alike:
        return replace(verdict, reasons=why)
    names = [c.name for c in alike if not c.is_form]
    forms = [c.name for c in alike if c.is_form]
    return Verdict("ambiguous", (named.name, *names, *forms[:1]), reasons=why)


def to_add(verdict: Verdict, candidates: Sequence[Candidate]) -> Candidate | None:
    """The candidate that the loop adds to the model; None where nothing helps enough.

    The one that is named; of several that explain the data as well, the first. Where the verdict
    is unknown, the best named effect is shown if it helps, though it does not explain the data.
    Nothing is added where it is none or an imperfection.
    """
    if verdict.status == "none" or verdict.effects in UNEVEN:
        return None
    if verdict.status == "unknown":
        best = best_named(candidates)
        return best if best.log_evidence > LEAST_GAIN else None
    return next(c for c in candidates if c.name == verdict.names[0])


def is_about_pairs(verdict: Verdict) -> bool:
    """Whether all hypotheses that a verdict is about are of several effects."""
    is_about_effects = verdict.status in ("named", "ambiguous")
    return is_about_effects and all("+" in name for name in verdict.names)

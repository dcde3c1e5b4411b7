"""The rules by which a formula becomes a law, or contests what a verdict is about.

As those of `verdict`, they need no trials and no fit; arguments are as there, formulas among the
candidates where nothing else is said.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.diagnosis import Candidate, Reason, Verdict
from galileo_jax.diagnosis.reasons import because
from galileo_jax.diagnosis.thresholds import FORMULA_ODDS, LENGTH_ODDS, MANY_CONSTANTS
from galileo_jax.diagnosis.verdict import best_named, contradicted, explains, verdict_of


def law_odds(num_factors: int) -> float:
    """How many times as likely as an effect with a name a formula is, before the data."""
    return FORMULA_ODDS * LENGTH_ODDS ** (num_factors - 1)


def needs_laws(verdict: Verdict, candidates: Sequence[Candidate]) -> bool:
    """Whether formulas are to be tried: nothing explains the data, or only what could explain much.

    Two effects at once, or one of many constants, come close to almost any motion; one formula may
    be simpler.
    """
    if verdict.status == "unknown":
        return True
    best = next(c for c in candidates if c.name in verdict.names[:1])
    return len(best.effects) > 1 or best.num_constants >= MANY_CONSTANTS


def contested_by_law(verdict: Verdict, candidates: Sequence[Candidate], decisive: float) -> Verdict:
    """The verdict where a formula explains the data about as well as what it is about, or better.

    One effect is ambiguous then, with the formula; two at once, or one that is far behind the
    formula, are not worth naming. Where only a form explains the data, the verdict is about the
    best effect with a name: the formula that says what the form does has to beat it. All else
    stays.
    """
    law, names = _best_law(candidates), verdict.names
    if verdict.form is not None and explains(best := best_named(candidates)):
        names = (best.name,)
    own = next((c for c in candidates if c.name in names), None)
    if law is None or own is None or own.log_odds - law.log_odds >= decisive:
        return verdict
    if len(own.effects) > 1 or law.log_odds - own.log_odds >= decisive:
        return replace(verdict, status="unknown", effects=())
    effects = verdict.effects or names
    return replace(verdict, status="ambiguous", effects=effects, form=None, law=law.law)


def best_formula(candidates: Sequence[Candidate]) -> Candidate | None:
    """The most probable formula of those that explain the data; if none does, of all.

    None where the missing force suggested none.
    """
    return _best_law(candidates) or next((c for c in candidates if c.law is not None), None)


def _best_law(candidates: Sequence[Candidate]) -> Candidate | None:
    """The most probable formula that explains the data."""
    return next((c for c in candidates if c.law is not None and explains(c)), None)


def proposed_formula(verdict: Verdict, candidates: Sequence[Candidate]) -> Candidate | None:
    """The formula that is worth trying as an effect: the law, one beside others, or the best.

    Where the verdict is unknown, the most probable of those that explain the data, if one does.
    """
    if verdict.law is not None:
        return next(c for c in candidates if c.law == verdict.law)
    best = best_formula(candidates) if verdict.status == "unknown" else None
    return best if best is not None and explains(best) else None


def law_to_doubt(candidates: Sequence[Candidate]) -> Candidate | None:
    """The best formula that explains the data where no single effect of the library does better.

    An effect of the library may say the same, and its fit have missed it.
    """
    law = _best_law(candidates)
    first = best_named([c for c in candidates if len(c.effects) == 1])
    is_behind = law is not None and (not explains(first) or first.log_odds < law.log_odds)
    return law if is_behind else None


def is_law_needed(
    verdict: Verdict, candidates: Sequence[Candidate], law: Candidate, decisive: float
) -> bool:
    """Whether a formula still says more than the library, whose effects were fitted once more.

    It does not where one effect with few constants explains the data and is not far behind: no
    formula would have been tried then.
    """
    if needs_laws(verdict, candidates):
        return True
    return law.log_odds - best_named(candidates).log_odds >= decisive


def other_formulas(law: Candidate, candidates: Iterable[Candidate]) -> tuple[Candidate, ...]:
    """The candidates without those that are the law's formula in another way.

    So is the law times a factor more if that is no more probable: the factor does nothing here.
    """
    return tuple(
        c
        for c in candidates
        if c.effects == law.effects
        or not (c.family == law.family or (_has_factors_of(law, c) and c.log_odds <= law.log_odds))
    )


def _has_factors_of(law: Candidate, other: Candidate) -> bool:
    """Whether a formula has all factors of a law, and more."""
    own, others = (set((c.family or "").split("*")) for c in (law, other))
    return own < others


def law_verdict(candidates: Sequence[Candidate], decisive: float) -> Verdict | None:
    """The verdict that a formula explains the data; None where none does and beats all others.

    It must do what a hypothesis that is named must, in a table without forms and laws of the same
    formula: whether it pushes or changes friction may not be told.
    """
    best = _best_law(candidates)
    if best is None:
        return None
    found = verdict_of(other_formulas(best, candidates), decisive)
    if found.status != "named" or found.effects != best.effects:
        return None
    return replace(found, status="law", law=best.law)


def law_contested(candidates: Sequence[Candidate], decisive: float) -> tuple[Reason, ...]:
    """Why there is no law, where formulas were fitted."""
    best = best_formula(candidates)
    if best is None:
        return (because("no_formula"),)
    if not explains(best):
        return (because("no_law_explains", best),)
    others = [c for c in other_formulas(best, candidates) if c.effects != best.effects]
    ahead = [c for c in others if best.log_odds - c.log_odds < decisive]
    alike = [c for c in ahead if explains(c)]
    if not ahead:  # no other alone, but all together
        return verdict_of((best, *others), decisive).reasons[1:]
    if not alike:
        return (contradicted(ahead[0], best),)
    return tuple(reasons.contested(best, c, decisive) for c in alike[:1])

"""The sentences that say why a verdict is what it is: a template for each rule that can fire."""

from collections.abc import Callable, Mapping, Sequence
from math import exp, log
from string import Formatter
from typing import Any

from galileo_jax.comparison.compare import ADEQUATE_P, Comparison
from galileo_jax.diagnosis.diagnosis import Candidate, Reason
from galileo_jax.diagnosis.friction_along_way import Stretch
from galileo_jax.diagnosis.thresholds import NOTABLE_NATS
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE

SMALLEST_P = 1e-12  # beyond it the tail is only extrapolated
PLAIN_ODDS = 10_000.0  # larger odds are written as a power of ten

# By rule; another way to say the same stands behind a colon. A field is one of the rule's numbers
# or words, or `hypothesis` or `rival`, with a format of `FORMATS` or of Python.
TEMPLATES = {
    # Of the model without effects.
    "nothing_moves": "No object leaves its place by more than {least_sds:g} times the error of its "
    "marks and {least_m:mm} mm: what does not move shows no effect.",
    "adequate_without_effects": "The data do not contradict the model without effects: "
    "{p_value:p} (at least {least_p_value:g} is needed).",
    "contradicted_without_effects": "The data contradict the model without effects: {p_value:p} "
    "(at least {least_p_value:g} is needed).",
    "noise_misstated": "The position errors look like noise, but {size} times as large as stated.",
    "nothing_convinces": "The best effect, {hypothesis}, is {log_odds:times} as probable as no "
    "effect; {least_log_odds:times} are needed, because the model without effects describes the "
    "data.",
    # Of pairs.
    "pairs_tried": "The best single effect, {hypothesis}, leaves more than noise ({p_value:p}), so "
    "{num_pairs} pairs of effects were tried.",
    "pairs_tried:form": "{form} explains the data better than any single effect, so {num_pairs} "
    "pairs of effects were tried.",
    "pairs_beside": "{hypothesis} explains the data ({p_value:p}), but two effects together may as "
    "well: {num_near} pairs of effects that come near it were fitted roughly, and the {num_pairs} "
    "most probable of them with care.",
    # Which of many far pairs is the nearest, chance decides: whole powers of ten are told.
    "no_pair_contests": "{num_near} pairs of effects that come near {hypothesis} were fitted "
    "roughly; each of them is more than {log_odds_behind:whole} less probable.",
    "second_possible": "Besides {hypothesis} another effect may act that is too weak to show here: "
    "probability {probability:percent}, most likely {second} ({probability_of_second:percent}).",
    "pair_ahead": "Two effects at once must leave p = {least_p_value:g} at least, because one "
    "formula might say it better; with {hypothesis} it is {p_value:p}, but formulas were tried, "
    "and all of them, and all other effects, are far less probable.",
    # Of what explains the data.
    "explains": "With {hypothesis} only noise is left ({p_value:p}); it is {log_odds:times} as "
    "probable as no effect.",
    "nothing_explains": "No effect, pair of effects or form without a name explains the data: with "
    "the most probable, {hypothesis}, {p_value:p}.",
    "no_law_explains": "No formula explains the data: with the most probable, {hypothesis}, "
    "{p_value:p}.",
    "no_formula": "No short formula was found that could explain the missing force.",
    "less_probable_than_none": "{hypothesis} explains the data, but is less probable than no "
    "effect: chance would explain them as well.",
    "better_but_contradicted": "{rival} is {log_odds_behind:times} as probable as {hypothesis}, "
    "but leaves more than noise ({p_value:p}): neither can be the truth.",
    "out_of_the_race": "{rival} would be {log_odds_behind:apart} as probable as {hypothesis}, but "
    "leaves more than noise ({p_value:p}; at least {least_p_value:g} is needed).",
    "only_a_form": "Only {hypothesis}, a form without a name, explains the data.",
    "only_a_form:name": "{hypothesis}, a form without a name, is {log_odds_behind:times} as "
    "probable as {rival}, the best effect with a name.",
    # Of rivals.
    "contested": "{second} explains the data, too: {first} is {log_odds_behind:apart} as probable "
    "as {second}; {least_log_odds:times} would be needed to decide.",
    "less_probable": "{second} explains the data, too: {first} is {log_odds_behind:apart} as "
    "probable as {second}; {least_log_odds:times} decide.",
    "contested_together": "{hypothesis} is {log_odds_behind:times} as probable as all other "
    "explanations together ({others} first); {least_log_odds:times} would be needed to decide.",
    "separated_by_prior": "{rival} explains the data, too. That {hypothesis} is "
    "{log_odds_behind:times} as probable comes from what was believed beforehand "
    "({log_prior_behind:times}); the data alone say {log_evidence_behind:times}, and "
    "{least_log_evidence:times} would be needed for a name.",
    "no_rival": "Only {best} explains the data.",
    "decisive": "{hypothesis} is {log_odds_behind:times} as probable as the next, {rival} "
    "({least_log_odds:times} are needed).{log_prior_behind:before}",
    "library_says_it": "The formula {rival} explains the data, but so does {hypothesis} of the "
    "library: no new formula is needed.",
    "told_apart": "If {hypothesis} is the truth, it is on average {log_odds_expected:times} as "
    "probable as {rival} after a clip like this one: enough to separate them.{lead:before}",
    "not_told_apart": "If {hypothesis} is the truth, it is on average {log_odds_expected:times} as "
    "probable as {rival} after a clip like this one: {least_log_odds:times} are needed."
    "{lead:before}",
    "constant_by_data": "{hypothesis} assumes that {constant} is {value:g}; from these data alone "
    "it is between {low:.2g} and {high:.2g} (95 %).",
    # Of imperfections.
    "imperfections_explain": "With imperfections, of sizes that are {size}, the data do not "
    "contradict the model without effects ({p_value:p}), and no effect beside them is "
    "{least_log_odds:times} as probable.",
    "form_beside": "{hypothesis}, a form without a name, is {log_odds:times} as probable as no "
    "effect; beside imperfections, which stand for anything smooth as well, "
    "{least_log_odds:times} are needed.",
    "imperfections_fail": "Imperfections of surfaces, hits and marks {why}.",
}
# Numbers that a template names and nobody gives: of the hypothesis, or of it and its rival.
KNOWN: Mapping[str, Callable[..., float | None]] = {
    "p_value": lambda best, rival: best.p_value,
    "log_odds": lambda best, rival: best.log_odds,
    "log_odds_behind": lambda best, rival: best.log_odds - rival.log_odds,
    "log_prior_behind": lambda best, rival: best.log_prior - rival.log_prior,
    "log_evidence_behind": lambda best, rival: best.log_evidence - rival.log_evidence,
}


def p_text(p: float | None) -> str:
    """A p-value without places that mean nothing."""
    if p is None:
        return ""
    return f"< {SMALLEST_P:.0e}" if p < SMALLEST_P else f"{p:.2g}"


def p_equals(p: float) -> str:
    """The same with its name."""
    return f"p {p_text(p)}" if p < SMALLEST_P else f"p = {p_text(p)}"


def times_text(nats: float) -> str:
    """How many times as probable: '20 times', '10^31 times', '1/13' for less than once."""
    if nats < 0:
        return f"1/{times_text(-nats).removesuffix(' times')}"
    if nats < log(PLAIN_ODDS):
        return f"{float(f'{exp(nats):.2g}'):g} times"  # 130, not 1.3e+02
    return f"10^{nats / log(10):.0f} times"


def _before_the_data(nats: float) -> str:
    """How much of a lead is prior, a sentence; empty where that is little."""
    said = f" Before the data it was already {times_text(nats)} as probable."
    return said if nats > NOTABLE_NATS else ""


FORMATS: Mapping[str, Callable[[Any], str]] = {
    "p": lambda p: p_equals(p or 0.0),
    "times": times_text,
    "apart": lambda nats: times_text(abs(nats)),
    "whole": lambda nats: times_text(log(10) * (nats // log(10))),
    "before": _before_the_data,
    "percent": lambda share: f"{100 * share:.0f} %",
    "mm": lambda metres: f"{1e3 * metres:g}",
}


class _Sentence(Formatter):
    """Formats fields by `FORMATS`."""

    def format_field(self, value: Any, format_spec: str) -> str:
        make = FORMATS.get(format_spec)
        return super().format_field(value, format_spec) if make is None else make(value)


def because(
    rule: str,
    hypothesis: Candidate | None = None,
    rival: Candidate | None = None,
    /,
    words: Mapping[str, Any] | None = None,
    **numbers: float | str | None,
) -> Reason:
    """The reason of a rule of `TEMPLATES` that fired, about a hypothesis and its rival.

    `words`: of the sentence, beside numbers and what the two are called. `numbers`: that the rule
    compared, beside those of `KNOWN`.
    """
    template = TEMPLATES[rule]
    both = {"hypothesis": hypothesis, "rival": rival}
    there = {key: candidate for key, candidate in both.items() if candidate is not None}
    fields = {field for _, field, _, _ in Formatter().parse(template)}
    asked = [name for name in KNOWN if name in fields - numbers.keys()]
    derived = {name: KNOWN[name](hypothesis, rival) for name in asked}
    numbers = {key: candidate.name for key, candidate in there.items()} | derived | numbers
    said = {**numbers, **{key: one.title for key, one in there.items()}, **(words or {})}
    return Reason(rule.partition(":")[0], _Sentence().format(template, **said), numbers)


def without_effects(comparison: Comparison) -> tuple[Reason, ...]:
    """Whether the data contradict the model without effects, and if not, the size of the noise."""
    said = "adequate" if comparison.is_adequate else "contradicted"
    found = because(f"{said}_without_effects", p_value=comparison.p_value, least_p_value=ADEQUATE_P)
    least, largest = min(comparison.noise_scale), max(comparison.noise_scale)
    low, high = NOISE_SCALE_RANGE
    if not comparison.is_adequate or low <= least <= largest <= high:
        return (found,)
    size = " to ".join(dict.fromkeys((f"{least:.2g}", f"{largest:.2g}")))
    numbers = {"noise_scale_least": least, "noise_scale_largest": largest}
    return because("noise_misstated", words={"size": size}, **numbers), found


def contested(best: Candidate, rival: Candidate, needed: float) -> Reason:
    """A rival explains the data, too: about as well, or one of both is far ahead."""
    behind = best.log_odds - rival.log_odds
    first, second = (best, rival) if behind >= 0 else (rival, best)
    rule = "contested" if abs(behind) < needed else "less_probable"
    words = {"first": first.title, "second": second.title}
    return because(rule, best, rival, words, least_log_odds=needed)


def decisive(best: Candidate, candidates: Sequence[Candidate], needed: float) -> Reason:
    """Nothing else of ranked candidates comes near the best, `needed` nats."""
    rival = next((c for c in candidates if c.effects != best.effects), None)
    if rival is None:
        return because("no_rival", words={"best": best.title})
    return because("decisive", best, rival, least_log_odds=needed)


def told_apart(best: Candidate, rival: Candidate, expected: float, needed: float) -> Reason:
    """Whether a clip like this one would tell the rival from the best, which would be named.

    `expected`: nats by which the rival is behind in a clip like this one, on average; `needed`: by
    which it must be.
    """
    return because(
        "told_apart" if expected >= needed else "not_told_apart",
        best,
        rival,
        {"lead": best.log_prior - rival.log_prior},
        log_odds_behind=best.log_odds - rival.log_odds,
        log_odds_expected=expected,
        least_log_odds=needed,
    )


def imperfections_explain(comparison: Comparison, needed: float) -> Reason:
    """Imperfections leave nothing but noise, and no effect beside them convinces, `needed` nats."""
    unusual = ", ".join(comparison.unusual)
    return because(
        "imperfections_explain",
        words={"size": f"larger than usual: {unusual}" if unusual else "usual"},
        p_value=comparison.p_value,
        unusual=unusual or None,
        least_log_odds=needed,
    )


def imperfections_fail(comparison: Comparison, pushing: Stretch | None) -> Reason:
    """Nor do imperfections explain what no effect explains; `pushing`: where friction would."""
    unusual = ", ".join(comparison.unusual)
    if pushing is not None:
        why = (
            f"explain it only with a friction coefficient of {pushing.mean:.2g} ± "
            f"{pushing.sd:.1g} of {pushing.name} from {pushing.from_m:.3g} to {pushing.to_m:.3g} "
            "m, and no surface pushes"
        )
    elif unusual:
        why = f"would have to be larger than usual: {unusual}"
    else:
        why = f"leave more than noise ({p_equals(comparison.p_value)})"
    numbers = {"p_value": comparison.p_value, "unusual": unusual or None}
    return because("imperfections_fail", words={"why": why}, **numbers)

"""The sentences that say why a verdict is what it is: one for each rule that fired."""

from collections.abc import Mapping, Sequence
from math import exp, floor, log

from galileo_jax.comparison.compare import ADEQUATE_P, Comparison
from galileo_jax.diagnosis.diagnosis import Candidate, Reason
from galileo_jax.diagnosis.friction_along_way import Stretch
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE
from galileo_jax.model.effects.forms.form import Form
from galileo_jax.observation.observation import AWAY_M, AWAY_SD

SMALLEST_P = 1e-12  # beyond it the tail is only extrapolated
NOTABLE_NATS = 1.0  # a prior that is more of a lead than this is mentioned
PLAIN_ODDS = 10_000.0  # larger odds are written as a power of ten


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


def nothing_moves() -> Reason:
    """No object is seen to move, so that no effect can show."""
    return Reason(
        "nothing_moves",
        f"No object leaves its place by more than {AWAY_SD:g} times the error of its marks and "
        f"{1e3 * AWAY_M:g} mm: what does not move shows no effect.",
        {"least_sds": AWAY_SD, "least_m": AWAY_M},
    )


def without_effects(comparison: Comparison) -> tuple[Reason, ...]:
    """Whether the data contradict the model without effects, and if not, the size of the noise.

    Args:
      comparison: of the model without effects; its p-value is that with noise of the size that
        is there.
    """
    p_value, is_adequate = comparison.p_value, comparison.is_adequate
    said = "do not contradict" if is_adequate else "contradict"
    found = Reason(
        "adequate_without_effects" if is_adequate else "contradicted_without_effects",
        f"The data {said} the model without effects: {p_equals(p_value)} "
        f"(at least {ADEQUATE_P:g} is needed).",
        {"p_value": p_value, "least_p_value": ADEQUATE_P},
    )
    scales, (low, high) = comparison.noise_scale, NOISE_SCALE_RANGE
    is_misstated = is_adequate and not low <= min(scales) <= max(scales) <= high
    return (noise_misstated(scales), found) if is_misstated else (found,)


def noise_misstated(noise_scale: Sequence[float]) -> Reason:
    """The errors look like noise, but not of the size that was stated.

    Args:
      noise_scale: of each clip, the errors' size over what is stated.
    """
    low, high = min(noise_scale), max(noise_scale)
    times = f"{high:.2g}" if f"{low:.2g}" == f"{high:.2g}" else f"{low:.2g} to {high:.2g}"
    return Reason(
        "noise_misstated",
        f"The position errors look like noise, but {times} times as large as stated.",
        {"noise_scale_least": low, "noise_scale_largest": high},
    )


def nothing_convinces(best: Candidate, needed: float) -> Reason:
    """Where the model without effects will do, the best effect does not convince."""
    return Reason(
        "nothing_convinces",
        f"The best effect, {best.title}, is {times_text(best.log_odds)} as probable as no effect; "
        f"{times_text(needed)} are needed, because the model without effects describes the data.",
        {"hypothesis": best.name, "log_odds": best.log_odds, "least_log_odds": needed},
    )


def pairs_tried(single: Candidate, form: Candidate | None, count: int) -> Reason:
    """Why pairs were tried.

    Args:
      single: the best effect alone.
      form: a form that explains the data better than it; None if there is none.
      count: how many pairs.
    """
    said = (
        f"The best single effect, {single.title}, leaves more than noise "
        f"({p_equals(single.p_value or 0.0)})"
        if form is None
        else f"{form.title} explains the data better than any single effect"
    )
    return Reason(
        "pairs_tried",
        f"{said}, so {count} pairs of effects were tried.",
        {"hypothesis": single.name, "p_value": single.p_value, "num_pairs": count},
    )


def pairs_beside(single: Candidate, num_near: int, count: int) -> Reason:
    """Which pairs were tried although a single effect leaves only noise.

    Args:
      single: the best effect alone.
      num_near: how many pairs were fitted roughly.
      count: how many of them were fitted with care.
    """
    return Reason(
        "pairs_beside",
        f"{single.title} explains the data ({p_equals(single.p_value or 0.0)}), but two effects "
        f"together may as well: {num_near} pairs of effects that come near it were fitted roughly, "
        f"and the {count} most probable of them with care.",
        {
            "hypothesis": single.name,
            "p_value": single.p_value,
            "num_near": num_near,
            "num_pairs": count,
        },
    )


def no_pair_contests(single: Candidate, pair: str, behind: float, num_near: int) -> Reason:
    """No pair of effects comes so near a single effect that it could contest its name.

    Args:
      single: the best effect alone.
      pair: the most probable of all pairs.
      behind: by how much it is behind, nats.
      num_near: how many pairs were fitted roughly.
    """
    # Which of many far ones is the nearest, chance decides.
    at_least = log(10) * floor(behind / log(10))
    return Reason(
        "no_pair_contests",
        f"{num_near} pairs of effects that come near {single.title} were fitted roughly; each of "
        f"them is more than {times_text(at_least)} less probable.",
        {
            "hypothesis": single.name,
            "rival": pair,
            "log_odds_behind": behind,
            "num_near": num_near,
        },
    )


def second_possible(named: Candidate, shares: Mapping[str, float]) -> Reason:
    """Another effect may act beside the one that is named, too weak to show.

    Args:
      named: a single effect.
      shares: of each other effect, how probable it is that it is there, too.
    """
    total, likeliest = sum(shares.values()), max(shares, key=lambda name: shares[name])
    return Reason(
        "second_possible",
        f"Besides {named.title} another effect may act that is too weak to show here: probability "
        f"{100 * total:.0f} %, most likely {likeliest} ({100 * shares[likeliest]:.0f} %).",
        {
            "hypothesis": named.name,
            "second": likeliest,
            "probability": total,
            "probability_of_second": shares[likeliest],
        },
    )


def explains(best: Candidate) -> Reason:
    """The best hypothesis of those that leave only noise."""
    return Reason(
        "explains",
        f"With {best.title} only noise is left ({p_equals(best.p_value or 0.0)}); "
        f"it is {times_text(best.log_odds)} as probable as no effect.",
        {"hypothesis": best.name, "p_value": best.p_value, "log_odds": best.log_odds},
    )


def pair_ahead(pair: Candidate, needed: float) -> Reason:
    """A pair that leaves a little more than noise is far ahead of all else, formulas too.

    Args:
      pair: the most probable hypothesis.
      needed: the p-value that a pair needs as long as formulas were not tried.
    """
    return Reason(
        "pair_ahead",
        f"Two effects at once must leave p = {needed:g} at least, because one formula might say "
        f"it better; with {pair.title} it is {p_equals(pair.p_value or 0.0)}, but formulas were "
        "tried, and all of them, and all other effects, are far less probable.",
        {"hypothesis": pair.name, "p_value": pair.p_value, "least_p_value": needed},
    )


def nothing_explains(best: Candidate) -> Reason:
    """No hypothesis leaves only noise."""
    p_value = best.p_value or 0.0
    return Reason(
        "nothing_explains",
        f"No effect, pair of effects or form without a name explains the data: with the most "
        f"probable, {best.title}, {p_equals(p_value)}.",
        {"hypothesis": best.name, "p_value": p_value},
    )


def no_law_explains(best: Candidate) -> Reason:
    """No formula that the missing force suggested leaves only noise."""
    law = best.law.text if best.law is not None else best.name
    return Reason(
        "no_law_explains",
        f"No formula explains the data: with the most probable, {law}, "
        f"{p_equals(best.p_value or 0.0)}.",
        {"hypothesis": best.name, "p_value": best.p_value},
    )


def no_formula() -> Reason:
    """The missing force suggested no formula."""
    return Reason(
        "no_formula", "No short formula was found that could explain the missing force.", {}
    )


def less_probable_than_none(best: Candidate) -> Reason:
    """What explains the data is less probable than no effect at all."""
    return Reason(
        "less_probable_than_none",
        f"{best.title} explains the data, but is less probable than no effect: chance would "
        "explain them as well.",
        {"hypothesis": best.name, "log_odds": best.log_odds},
    )


def better_but_contradicted(better: Candidate, best: Candidate) -> Reason:
    """A hypothesis that the data contradict is far more probable than the best that explains."""
    ahead = better.log_odds - best.log_odds
    return Reason(
        "better_but_contradicted",
        f"{better.title} is {times_text(ahead)} as probable as {best.title}, but leaves more than "
        f"noise ({p_equals(better.p_value or 0.0)}): neither can be the truth.",
        {
            "hypothesis": best.name,
            "rival": better.name,
            "log_odds_behind": ahead,
            "p_value": better.p_value,
        },
    )


def out_of_the_race(better: Candidate, best: Candidate, needed: float) -> Reason:
    """A hypothesis that the data contradict is a little more probable than the best that explains.

    Args:
      better: the most probable.
      best: the most probable of those that explain the data.
      needed: the p-value that the first lacks.
    """
    ahead = better.log_odds - best.log_odds
    return Reason(
        "out_of_the_race",
        f"{better.title} would be {times_text(ahead)} as probable as {best.title}, but leaves more "
        f"than noise ({p_equals(better.p_value or 0.0)}; at least {needed:g} is needed).",
        {
            "hypothesis": best.name,
            "rival": better.name,
            "log_odds_behind": -ahead,
            "p_value": better.p_value,
            "least_p_value": needed,
        },
    )


def only_a_form(form: Candidate, name: Candidate | None) -> Reason:
    """A form without a name explains the data, and no name does as well.

    Args:
      form: the best.
      name: the best hypothesis with a name that explains the data; None if there is none.
    """
    if name is None:
        return Reason(
            "only_a_form",
            f"Only {form.title}, a form without a name, explains the data.",
            {"hypothesis": form.name, "p_value": form.p_value},
        )
    ahead = form.log_odds - name.log_odds
    return Reason(
        "only_a_form",
        f"{form.title}, a form without a name, is {times_text(ahead)} as probable as {name.title}, "
        "the best effect with a name.",
        {"hypothesis": form.name, "rival": name.name, "log_odds_behind": ahead},
    )


def contested(best: Candidate, rival: Candidate, needed: float) -> Reason:
    """A rival explains the data, too: about as well, or one of both is far ahead."""
    behind = best.log_odds - rival.log_odds
    first, second = (best, rival) if behind >= 0 else (rival, best)
    is_close = abs(behind) < needed
    return Reason(
        "contested" if is_close else "less_probable",
        f"{rival.title} explains the data, too: {first.title} is {times_text(abs(behind))} as "
        f"probable as {second.title}; {times_text(needed)} "
        f"{'would be needed to decide' if is_close else 'decide'}.",
        {
            "hypothesis": best.name,
            "rival": rival.name,
            "log_odds_behind": behind,
            "least_log_odds": needed,
        },
    )


def contested_together(
    best: Candidate, others: Sequence[Candidate], ahead: float, needed: float
) -> Reason:
    """Each rival is given up, but not all together.

    Args:
      best: the most probable that explains the data.
      others: the most probable of the rivals, which explain the data, too.
      ahead: nats by which the best is more probable than all rivals together.
      needed: nats by which it must be.
    """
    return Reason(
        "contested_together",
        f"{best.title} is {times_text(ahead)} as probable as all other explanations together "
        f"({', '.join(c.title for c in others)} first); {times_text(needed)} would be needed to "
        "decide.",
        {
            "hypothesis": best.name,
            "rival": others[0].name,
            "log_odds_behind": ahead,
            "least_log_odds": needed,
        },
    )


def separated_by_prior(best: Candidate, rival: Candidate, needed: float) -> Reason:
    """The data themselves hardly tell a rival from the best.

    Args:
      best: the most probable that explains the data.
      rival: another that does, and that was less probable before the data.
      needed: nats of evidence by which it must be behind.
    """
    behind = best.log_evidence - rival.log_evidence
    ahead = best.log_prior - rival.log_prior
    return Reason(
        "separated_by_prior",
        f"{rival.title} explains the data, too. That {best.title} is "
        f"{times_text(best.log_odds - rival.log_odds)} as probable comes from what was believed "
        f"beforehand ({times_text(ahead)}); the data alone say {times_text(behind)}, and "
        f"{times_text(needed)} would be needed for a name.",
        {
            "hypothesis": best.name,
            "rival": rival.name,
            "log_odds_behind": best.log_odds - rival.log_odds,
            "log_evidence_behind": behind,
            "log_prior_behind": ahead,
            "least_log_evidence": needed,
        },
    )


def _before_the_data(best: Candidate, rival: Candidate) -> str:
    """How much of a lead is prior, a sentence; empty where that is little."""
    ahead = best.log_prior - rival.log_prior
    return (
        f" Before the data it was already {times_text(ahead)} as probable."
        if ahead > NOTABLE_NATS
        else ""
    )


def decisive(best: Candidate, candidates: Sequence[Candidate], needed: float) -> Reason:
    """Nothing else comes near the best.

    Args:
      best: the hypothesis that is named.
      candidates: ranked; none that the data contradict stands near the best.
      needed: nats by which the next must be behind.
    """
    others = [c for c in candidates if c.effects != best.effects]
    if not others:
        return Reason("no_rival", f"Only {best.title} explains the data.", {})
    behind = best.log_odds - others[0].log_odds
    return Reason(
        "decisive",
        f"{best.title} is {times_text(behind)} as probable as the next, {others[0].title} "
        f"({times_text(needed)} are needed).{_before_the_data(best, others[0])}",
        {
            "hypothesis": best.name,
            "rival": others[0].name,
            "log_odds_behind": behind,
            "log_prior_behind": best.log_prior - others[0].log_prior,
            "least_log_odds": needed,
        },
    )


def library_says_it(best: Candidate, law: Candidate) -> Reason:
    """A formula explains the data, and an effect of the library says the same.

    Args:
      best: the effect.
      law: the formula.
    """
    return Reason(
        "library_says_it",
        f"The formula {law.title} explains the data, but so does {best.title} of the library: no "
        "new formula is needed.",
        {
            "hypothesis": best.name,
            "rival": law.name,
            "log_odds_behind": best.log_odds - law.log_odds,
        },
    )


def told_apart(best: Candidate, rival: Candidate, expected: float, needed: float) -> Reason:
    """Whether a clip like this one would tell the rival from the hypothesis that is named.

    Args:
      best: the hypothesis that would be named.
      rival: another that could be confused with it.
      expected: nats by which the rival is behind in a clip like this one, on average.
      needed: nats by which it must be.
    """
    is_told = expected >= needed
    return Reason(
        "told_apart" if is_told else "not_told_apart",
        f"If {best.title} is the truth, it is on average {times_text(expected)} as probable as "
        f"{rival.title} after a clip like this one: "
        + ("enough to separate them." if is_told else f"{times_text(needed)} are needed.")
        + _before_the_data(best, rival),
        {
            "hypothesis": best.name,
            "rival": rival.name,
            "log_odds_behind": best.log_odds - rival.log_odds,
            "log_odds_expected": expected,
            "least_log_odds": needed,
        },
    )


def constant_by_data(named: Candidate, form: Form, low: float, high: float) -> Reason:
    """What the data say of a constant that a name takes for known.

    Args:
      named: the effect that is named.
      form: what it is with the constant free.
      low: of the constant's 95 % interval.
      high: of the same.
    """
    known = form.named_values[named.name]
    return Reason(
        "constant_by_data",
        f"{named.title} assumes that {form.constant_words} is {known:g}; from these data alone it "
        f"is between {low:.2g} and {high:.2g} (95 %).",
        {
            "hypothesis": named.name,
            "form": form.name,
            "value": known,
            "low": low,
            "high": high,
        },
    )


def imperfections_explain(comparison: Comparison, needed: float) -> Reason:
    """Imperfections leave nothing but noise without any effect.

    Args:
      comparison: of the model without effects, with imperfections.
      needed: log odds at which an effect beside them would be believed.
    """
    size = f"larger than usual: {', '.join(comparison.unusual)}" if comparison.unusual else "usual"
    return Reason(
        "imperfections_explain",
        f"With imperfections, of sizes that are {size}, the data do not contradict the model "
        f"without effects ({p_equals(comparison.p_value)}), and no effect beside them is "
        f"{times_text(needed)} as probable.",
        {
            "p_value": comparison.p_value,
            "unusual": ", ".join(comparison.unusual) or None,
            "least_log_odds": needed,
        },
    )


def imperfections_fail(comparison: Comparison, pushing: Stretch | None) -> Reason:
    """Nor do imperfections explain what no effect explains.

    Args:
      comparison: as above.
      pushing: where uneven friction would have to push.
    """
    why = (
        f"explain it only with a friction coefficient of {pushing.mean:.2g} ± {pushing.sd:.1g} of "
        f"{pushing.name} from {pushing.from_m:.3g} to {pushing.to_m:.3g} m, and no surface pushes"
        if pushing is not None
        else f"would have to be larger than usual: {', '.join(comparison.unusual)}"
        if comparison.unusual
        else f"leave more than noise ({p_equals(comparison.p_value)})"
    )
    return Reason(
        "imperfections_fail",
        f"Imperfections of surfaces, hits and marks {why}.",
        {"p_value": comparison.p_value, "unusual": ", ".join(comparison.unusual) or None},
    )

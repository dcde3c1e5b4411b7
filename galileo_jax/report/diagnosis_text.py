"""The results of a comparison and of a diagnosis as sentences, for the terminal and the pages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.diagnosis.law_verdict import proposed_formula
from galileo_jax.diagnosis.reasons import p_equals
from galileo_jax.diagnosis.reasons import p_text as p_text
from galileo_jax.diagnosis.verdict import UNEVEN
from galileo_jax.inference.per_mass import SUFFIX
from galileo_jax.report.phrases import listed
from galileo_jax.results.command_line import command_line
from galileo_jax.results.shown import value_text
from galileo_jax.search.hypothesis import Hypothesis
from galileo_jax.statespace.terms import ROUGHNESS, TERMS

NO_EFFECTS = "no effects"
MOST_APART = 2  # that are said one by one
PROPOSED = "proposed_effect.py"  # in the folder of a diagnosis: a formula that explains the data


def effects_text(effects: Sequence[str]) -> str:
    """The effects of a model."""
    return ", ".join(effects) or NO_EFFECTS


def round_text(row: Mapping[str, Any]) -> str:
    """What the model of a round has, of a row of `history` in diagnosis.json."""
    text = effects_text(row["effects"])
    return f"{text}, imperfect" if row.get("imperfect") and not row["effects"] else text


def adequacy(record: Mapping[str, Any]) -> str:
    """Whether the model of compare.json is adequate, in one sentence; or why nobody can tell."""
    if record["no_verdict"] is not None:
        return f"{record['no_verdict']}."
    equals = p_equals(record["p_value"])
    model = f"with {effects_text(record['effects'])} " if record["effects"] else ""
    if not record["adequate"]:
        return f"The model {model}is not adequate: the data contradict it ({equals})."
    text = f"The model {model}is adequate: its residuals look like noise ({equals})"
    if asked := record.get("in_question"):
        return f"{text}, but {listed(asked, 'or')} may be missing: galileo diagnose tells."
    if record.get("rests_on_imperfections"):
        return f"{text}, beside imperfections; an effect may be better: galileo diagnose tells."
    text = f"{text}."
    return f"{text} {noise_text(record['noise_scale'])}" if record["noise_misstated"] else text


def noise_text(noise_scale: Sequence[float]) -> str:
    """How wrong the stated noise is, in a sentence."""
    size = " and ".join(f"{scale:.1f}" for scale in noise_scale)
    return f"The tracking errors are {size} times as large as stated."


def why(reasons: Sequence[Mapping[str, Any]]) -> list[str]:
    """The rules that fired, one sentence each; of hypotheses that could not be confused, one."""
    said = [one["sentence"] for one in reasons if one["rule"] != "told_apart"]
    if (apart := len(reasons) - len(said)) <= MOST_APART:
        return [one["sentence"] for one in reasons]
    return [*said, f"A clip like this one would rule out {apart} others (report.html)."]


def verdict(diagnosis: Diagnosis) -> str:
    """Which effect the model lacks, in one sentence."""
    found, without = diagnosis.verdict, p_equals(diagnosis.base.p_value)
    if any(why.rule == "nothing_moves" for why in found.reasons):
        return "Nothing moves: no effect can be told."
    if found.status == "none":
        noise = [why.sentence for why in found.reasons if why.rule == "noise_misstated"]
        return " ".join([f"The model is adequate: no effect is missing ({without}).", *noise])
    if found.effects in UNEVEN:
        last = diagnosis.rounds[-1]
        return (
            f"{found.effects[0]} explains the data: the friction coefficient varies by "
            f"{roughness(last.hypothesis):.2g} along the way, more than on most surfaces "
            f"({without} without, {p_equals(last.comparison.p_value)} with)."
        )
    if found.status == "ambiguous":
        formula = () if found.law is None else (f"the formula ({found.law.text})",)
        return ambiguity((*found.effects, *formula))
    chosen = {candidate.effects: candidate.p_value for candidate in diagnosis.candidates}
    p = chosen.get(found.effects)
    if found.status == "named":
        verb = "explains" if len(found.effects) == 1 else "together explain"
        both = "" if p is None else f" ({without} without, {p_equals(p)} with)"
        return f"{' and '.join(found.effects)} {verb} the data{both}."
    if found.law is not None:
        return (
            f"No known effect explains the data; a law does: {found.law.text} "
            f"({without} without, {p_equals(p or 0.0)} with)."
        )
    where = "; see the missing force" if diagnosis.missing is not None else ""
    return f"{_leading(diagnosis)}No known effect explains the data{where}."


def _leading(diagnosis: Diagnosis) -> str:
    """Which hypothesis takes nearly all of the error away, though not all; "" where none does."""
    best = diagnosis.nearly
    if best is None:
        return ""
    share = diagnosis.share_explained(best)
    verb = "takes" if len(best.effects) == 1 else "together take"
    names = " and ".join(best.effects)
    return f"{names} {verb} {100 * min(share, 0.99):.0f} % of the error away, though not all. "


def roughness(hypothesis: Hypothesis) -> float:
    """By how much friction varies along the way, as a coefficient, with a hypothesis.

    Raises:
      ValueError: it knows no such imperfection.
    """
    sizes, trials = hypothesis.fit.sizes, hypothesis.trials
    if sizes is None or trials is None or ROUGHNESS not in sizes.by_name:
        raise ValueError("a hypothesis without imperfections of friction")
    return trials.problems[0].size(TERMS[ROUGHNESS], sizes.by_name[ROUGHNESS])


def ambiguity(rivals: Sequence[str]) -> str:
    """What a clip cannot tell, in one sentence; what all have in common is told first.

    `rivals`: hypotheses, the effects of each joined by +.
    """
    hypotheses = [rival.split("+") for rival in rivals]
    common = [name for name in hypotheses[0] if all(name in own for own in hypotheses)]
    if not common:
        alone, beside = _without_company(hypotheses)
        names = listed(alone)
        together = f", alone or together with {listed(beside, 'or')}" if beside else ""
        return (
            f"This clip cannot distinguish between {names}; each of them explains the data"
            f"{together}."
        )
    rest = ["+".join(n for n in own if n not in common) for own in hypotheses]
    others = [name for name in rest if name]
    alone = "" if len(others) == len(rest) else "alone or "
    return (
        f"{' and '.join(common)} explains the data {alone}together with {listed(others, 'or')}; "
        f"this clip cannot tell which."
    )


def _without_company(hypotheses: Sequence[Sequence[str]]) -> tuple[list[str], list[str]]:
    """The hypotheses that no other one is part of, and what else stands beside one of them.

    Where fewer than two are left, all stay.
    """
    least = [own for own in hypotheses if not any(set(one) < set(own) for one in hypotheses)]
    beside = [
        name
        for own in hypotheses
        if own not in least
        for name in own
        if not any(name in one and set(one) < set(own) for one in least)
    ]
    if len(least) < 2:
        return ["+".join(own) for own in hypotheses], []
    return ["+".join(own) for own in least], list(dict.fromkeys(beside))


def formula_text(record: Mapping[str, Any]) -> str:
    """What the best formula says of the missing force, in one sentence; empty where none is."""
    if (missing := record.get("missing_force")) is None:
        return ""
    if (best := missing["best_formula"]) is None:
        return "No short formula was found that could explain the missing force."
    leaves = (
        f"{p_equals(best['p_value'])}, chi2 per degree of freedom {best['chi2_per_dof']:.2f}, "
        f"probability {best['probability']:.2g}"
    )
    if not best["explains"]:
        return (
            f"No formula explains the missing force. The best one, {best['law']}, leaves more "
            f"than noise ({leaves})."
        )
    if record["verdict"]["status"] == "law":
        return f"A formula explains the missing force: {best['law']} ({leaves})."
    return (
        f"A formula explains the missing force, but it is not certain (see why): {best['law']} "
        f"({leaves}). galileo diagnose writes it to {PROPOSED}, to be tried as an effect."
    )


CLIPS_KINDS = {
    "shared": "each clip alone agrees with the model: a parameter that they share differs "
    "between them",
    "some": "some clips alone agree with the model, others do not",
    "alike": "no clip alone agrees with the model; the missing acceleration along the path is the "
    "same in all, within its errors",
    "different": "no clip alone agrees with the model, and the missing acceleration along the path "
    "differs between them: it does not depend on position alone",
}


def each_clip(record: Mapping[str, Any] | None) -> list[str]:
    """How clips that no model explains together differ: `each_clip` of diagnosis.json."""
    if record is None:
        return []
    found = [f"clips: {CLIPS_KINDS[record['kind']]}"]
    for one in record["clips"]:
        extra = zip(one["extra_acceleration_m_s2"], one["sd_m_s2"], strict=True)
        parts = ", ".join(f"{value:+.3f} +- {sd:.3f}" for value, sd in extra)
        found.append(
            f"{one['clip']}: chi2 per value {one['chi2_together']:.2f} when fitted with the "
            f"others, {one['chi2_alone']:.2f} alone ({p_equals(one['p_alone'])}); missing "
            f"acceleration in each quarter of its path: {parts} m/s^2"
        )
    return found


def next_command(
    diagnosis: Diagnosis,
    clips: Sequence[str],
    effects_from: Sequence[str] = (),
    folder: Path = Path(),
) -> str:
    """The command to run next; `folder`: where the diagnosis is saved."""
    files, found = tuple(effects_from), diagnosis.verdict
    if found.status == "none" or found.effects in UNEVEN:
        return command_line("fit", clips)
    effects: Sequence[str] = found.effects
    if found.status == "ambiguous":
        effects = found.effects[0].split("+")
    if found.status == "unknown":
        formula = proposed_formula(found, diagnosis.candidates)
        if formula is None:
            return command_line("diagnose", clips, effects_from=(*files, "my_effect.py"))
        effects = formula.effects
    if found.status in ("law", "unknown"):
        files = (*files, str(folder / PROPOSED))
    return command_line("fit", clips, effects_from=files, effects=",".join(effects))


def strength_texts(entry: Mapping[str, Any], sign: str = "+-") -> dict[str, str]:
    """The strengths of a candidate's effects as text, by name; one per clip where they differ.

    Where no object was weighed, a force is given per mass: only that is determined. `entry`: of the
    candidate in diagnosis.json; `sign`: before a standard deviation.
    """
    derived, parameters = entry.get("derived", {}), entry["parameters"]
    found = {}
    for effect in entry["effect"].split("+"):
        for name, strength in parameters.items():
            if name != effect and not name.removeprefix(f"{effect}_").isdecimal():
                continue
            per_mass = derived.get(f"{name}{SUFFIX}")
            text = value_text(per_mass or strength, sign)
            found[name] = f"{text} (over m1)" if per_mass else text
    return found

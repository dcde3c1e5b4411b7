"""What a comparison and a diagnosis found, in plain sentences: for the terminal and the pages."""

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from galileo_jax.comparison.compare import Comparison, Place, Pull
from galileo_jax.diagnosis.diagnosis import Diagnosis
from galileo_jax.inference.per_mass import SUFFIX
from galileo_jax.report.statements import number

SMALLEST_P = 1e-12  # beyond it the tail is only extrapolated
NO_EFFECTS = "no effects"


def p_text(p: float | None) -> str:
    """A p-value without places that mean nothing."""
    if p is None:
        return ""
    return f"< {SMALLEST_P:.0e}" if p < SMALLEST_P else f"{p:.2g}"


def p_equals(p: float) -> str:
    """The same with its name."""
    return f"p {p_text(p)}" if p < SMALLEST_P else f"p = {p_text(p)}"


def effects_text(effects: Sequence[str]) -> str:
    """The effects of a model."""
    return ", ".join(effects) or NO_EFFECTS


def value_text(entry: Mapping[str, Any]) -> str:
    """A parameter's mean, standard deviation and unit."""
    unit = "" if entry["unit"] == "1" else f" {entry['unit']}"
    sd = entry["sd"]
    return f"{number(entry['mean'], sd)} +- {number(sd, sd)}{unit}"


def adequacy(comparison: Comparison, effects: Sequence[str]) -> str:
    """Whether the model is adequate, in one sentence."""
    equals = p_equals(comparison.p_value)
    model = f"with {effects_text(effects)} " if effects else ""
    if comparison.is_adequate:
        return f"The model {model}is adequate: what it leaves over is noise ({equals})."
    return f"The model {model}is not adequate: the data contradict it ({equals})."


def place_text(place: Place) -> str:
    """One cell in words."""
    return f"{place.object}, {place.axis}, {place.phase}"


def pull_text(pull: Pull) -> str:
    """One nuisance outside its prior, in words."""
    unit = "" if pull.unit == "1" else f" {pull.unit}"
    return (
        f"{pull.parameter} is bent to {pull.value:.4g}{unit}, "
        f"{abs(pull.z):.1f} standard deviations of its prior away"
    )


def verdict(diagnosis: Diagnosis) -> str:
    """What is missing, in one sentence."""
    found, first = diagnosis.verdict, diagnosis.base
    if found.status == "none":
        return f"The model is fine: nothing is missing ({p_equals(first.p_value)})."
    if found.status == "named":
        names = " and ".join(found.effects)
        verb = "explains" if len(found.effects) == 1 else "together explain"
        chosen = {candidate.effects: candidate for candidate in diagnosis.candidates}
        p = chosen[found.effects].p_value if found.effects in chosen else None
        told = "" if p is None else f" ({p_equals(first.p_value)} without, {p_equals(p)} with)"
        return f"{names} {verb} the data{told}."
    if found.status == "ambiguous":
        names = ", ".join(found.effects)
        return f"These cannot be told apart here: {names}; each of them explains the data."
    where = "; see the missing force" if diagnosis.missing is not None else ""
    return f"Something I do not know: no effect that I know explains the data{where}."


CLIPS_KINDS = {
    "shared": "each clip fits by itself: what they share is not the same in all of them",
    "some": "some clips fit by themselves, others do not",
    "alike": "no clip fits by itself; what they miss along the way is the same within its errors",
    "different": "no clip fits by itself, and each misses something else along the way: "
    "it does not belong to the place",
}


def each_clip(record: Mapping[str, Any]) -> list[str]:
    """How clips that are not explained together differ: `each_clip` of diagnosis.json."""
    found = [f"clips: {CLIPS_KINDS[record['kind']]}"]
    for one in record["clips"]:
        parts = ", ".join(
            f"{extra:+.3f} +- {sd:.3f}"
            for extra, sd in zip(one["extra_acceleration_m_s2"], one["sd_m_s2"], strict=True)
        )
        found.append(
            f"{one['clip']}: chi2 {one['chi2_together']:.2f} per value, by itself "
            f"{one['chi2_alone']:.2f} ({p_equals(one['p_alone'])}); accelerates more than the "
            f"model of all by {parts} m/s^2 in the quarters of its way"
        )
    return found


def how_to_go_on(
    diagnosis: Diagnosis, clips: Sequence[str], effects_from: Sequence[str] = ()
) -> str:
    """The command that comes next."""
    files = shlex.join(clips)
    more = "".join(f" --effects-from {shlex.quote(path)}" for path in effects_from)
    found = diagnosis.verdict
    if found.status == "none":
        return f"galileo fit {files}"
    if found.status == "unknown":
        return f"galileo diagnose {files}{more} --effects-from my_effect.py"
    effects = found.effects if found.status == "named" else found.effects[0].split("+")
    return f"galileo fit {files}{more} --effects {','.join(effects)}"


def strength_texts(effects: Sequence[str], told: Mapping[str, Any]) -> dict[str, str]:
    """The strengths of a candidate's effects as text, by name.

    Where nobody weighed the objects, a force is told per mass: its constant is not determined.

    Args:
      effects: of the candidate.
      told: its entry in diagnosis.json.
    """
    derived = told.get("derived", {})
    found = {}
    for name, entry in strengths(effects, told["parameters"]).items():
        of_mass = derived.get(f"{name}{SUFFIX}")
        found[name] = f"{value_text(of_mass)} (over m1)" if of_mass else value_text(entry)
    return found


def strengths(
    effects: Sequence[str], parameters: Mapping[str, Mapping[str, Any]]
) -> dict[str, Mapping[str, Any]]:
    """The entries of the effects' strengths; one per clip where each clip has its own."""
    found = {}
    for effect in effects:
        own = [
            name
            for name in parameters
            if name == effect or name.removeprefix(f"{effect}_").isdecimal()
        ]
        found |= {name: parameters[name] for name in own}
    return found

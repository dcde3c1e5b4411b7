"""The result in the words of a lab report: one paragraph, of what the files of a run say."""

import re
from collections.abc import Callable, Mapping, Sequence
from math import hypot
from typing import Any

from galileo_jax.diagnosis.reasons import p_equals
from galileo_jax.inference.per_mass import SUFFIX
from galileo_jax.report.diagnosis_text import noise_text
from galileo_jax.report.fit_text import imperfection_text, meaning, nearness
from galileo_jax.report.phrases import listed, sentence, two_figures
from galileo_jax.results.shown import is_as_declared, shown, shown_parameters

NUMBERED = re.compile(r"(object ?)?\d*", re.IGNORECASE)  # a name that says nothing
BODIES = {"box": "block", "cylinder": "cylinder", "torus": "ring", "sphere": "ball"}
FRICTION, RATIO = re.compile(r"k(\d+)"), re.compile(r"mass_ratio(?:_(\d+)_(\d+))?")
MOST_UNSEEN = 3  # effects of which it is said what could not have been seen
SHARES = {"frame_rate": "a frame rate", "scale_error": "a scale"}  # strength 0.01: 1 % off
OTHER_SDS = 2.0  # standard deviations of their difference: numbers that are not the same
SAME_AS_RATIO = "phi"  # says again what the ratio of the masses says


def paragraph(
    result: Mapping[str, Any],
    check: Mapping[str, Any],
    diagnosis: Mapping[str, Any] | None = None,
    shapes: Sequence[str] = (),
    names: Sequence[str] = (),
    rolls: Sequence[bool] = (),
) -> str:
    """What was measured, how well the model follows it, what is missing, what could not be seen.

    Of result.json, of compare.json of the model without what was found missing, and, where
    something is, of diagnosis.json; `shapes`, `names` and whether they roll: of the objects, as
    declared.
    """
    entries = {
        name: entry for name, entry in shown_parameters(result).items() if name != SAME_AS_RATIO
    }
    known = {name: entry for name, entry in entries.items() if entry["identified"]}
    effects = {
        name: entry
        for name, entry in known.items()
        if any(name == one or name.startswith(f"{one}_") for one in result["effects"])
    }
    rest = {
        name: entry
        for name, entry in known.items()
        if name not in effects and not FRICTION.fullmatch(name) and not RATIO.fullmatch(name)
    }
    who = _who(shapes, names)
    status = "" if diagnosis is None else str(diagnosis["verdict"]["status"])
    model = f" with {'a law' if status == 'law' else _all(result)}" if result["effects"] else ""
    near, found = ", ".join(nearness(result["error"])), result.get("imperfections")
    open_ones = [
        name for name, entry in entries.items() if name not in known and not is_as_declared(entry)
    ]
    rolled = {f"k{number}" for number, one in enumerate(rolls, start=1) if one}
    is_in_doubt = status in ("ambiguous", "unknown") and result["effects"]
    said = [
        *(f"Check first: {one}." for one in result.get("impossible", ())),
        "Until that is settled, what follows is no result." if result.get("impossible") else "",
        _frictions(known, who, shapes),
        *_ratios(known, who),
        _values(rest),
        _rolled([name for name in open_ones if name in rolled], who),
        _unknown([name for name in open_ones if name not in rolled], known),
        f"The model{model} follows the motion to {near}." if near else "",
        *(imperfection_text(found, result["error"]) if found else []),
        _verdict(result, check, diagnosis),
        "" if status == "law" else _values(effects),  # the law's text has them
        f"All values are those with {_all(result)}{_otherwise(result, known, diagnosis)}."
        if is_in_doubt
        else "",
        _gravity(check),
        unseen_text(check, diagnosis),
    ]
    return " ".join(filter(None, said))


def _words(name: str) -> str:
    """An effect's name in words."""
    return name.replace("_", " ")


def _all(result: Mapping[str, Any]) -> str:
    return listed([_words(one) for one in result["effects"]])


def _value(entry: Mapping[str, Any]) -> str:
    """A value, its standard deviation and its unit, as a lab report writes them."""
    return f"{shown(entry)} ± {shown(entry, 'sd')}{_unit(entry['unit'])}"


def _unit(unit: str) -> str:
    plain = unit.replace("^2", "²").removeprefix("1")
    return f" {plain}" if plain else ""


def _who(shapes: Sequence[str], names: Sequence[str]) -> Callable[[str], str]:
    """What the bodies are called, by their numbers: by their names, where people gave them some."""
    body = BODIES.get(shapes[0], "body") if shapes else "body"
    is_named = len(names) > 1 and not any(map(NUMBERED.fullmatch, names))

    def called(number: str) -> str:
        if is_named and int(number) <= len(names):
            return names[int(number) - 1]
        return f"the {body}" if number == "1" else f"object {number}"

    return called


def _frictions(known: Mapping[str, Any], who: Callable[[str], str], shapes: Sequence[str]) -> str:
    """How the bodies slid."""
    found = [(m[1], entry) for name, entry in known.items() if (m := FRICTION.fullmatch(name))]
    parts: list[str] = []
    for number, entry in found:
        is_round = int(number) <= len(shapes) and shapes[int(number) - 1] != "box"
        verb = f"{'moved' if is_round else 'slid'} with a friction coefficient of"
        parts.append(f"{who(number)} {'with' if parts else verb} {_value(entry)}")
    return sentence(", ".join(parts)) if parts else ""


def _rolled(frictions: Sequence[str], who: Callable[[str], str]) -> str:
    """Of bodies that roll, whose friction is not known."""
    if not frictions:
        return ""
    bodies = listed([who(name.removeprefix("k")) for name in frictions])
    return sentence(f"{bodies} rolled without slipping, so that friction does not show")


def _ratios(known: Mapping[str, Any], who: Callable[[str], str]) -> list[str]:
    """How heavy the bodies are beside each other."""
    return [
        sentence(f"{who(m[1] or '1')} is {_value(entry)} times as heavy as {who(m[2] or '2')}")
        for name, entry in known.items()
        if (m := RATIO.fullmatch(name))
    ]


def _values(entries: Mapping[str, Any]) -> str:
    """All in one sentence."""
    parts = []
    for name, entry in entries.items():
        what = _called(name)
        parts.append(f"the {what}{',' if ',' in what else ''} is {_value(entry)}")
    return sentence("; ".join(parts)) if parts else ""


def _called(name: str) -> str:
    """A parameter in a phrase without an article."""
    if name.endswith(SUFFIX):
        return f"{_words(name.removesuffix(SUFFIX))} over the mass"
    if RATIO.fullmatch(name):
        return f"ratio of the masses {meaning(name)}"
    return meaning(name) or _words(name)


def _unknown(names: Sequence[str], known: Mapping[str, Any]) -> str:
    """What the clip does not determine; a force that is known per mass counts as known."""
    open_ones = [f"the {_called(name)}" for name in names if f"{name}{SUFFIX}" not in known]
    return f"This clip does not determine {listed(open_ones)}." if open_ones else ""


def _verdict(
    result: Mapping[str, Any], check: Mapping[str, Any], diagnosis: Mapping[str, Any] | None
) -> str:
    if diagnosis is not None:
        text = _words(str(diagnosis["sentence"]))  # names of effects, in words
        return f"{text[:1].upper()}{text[1:]}"
    if check.get("adequate") is None or result.get("no_verdict"):
        return f"{result.get('no_verdict') or 'Whether the model is right cannot be told'}."
    p = p_equals(check["p_value"])
    if not check["adequate"]:
        return f"The data contradict the model ({p})."
    if asked := check.get("in_question"):
        lacks = listed([_words(name) for name in asked], "or")
        return f"What it leaves looks like noise ({p}), but {lacks} may be missing."
    if check.get("rests_on_imperfections"):
        return (
            f"What it leaves looks like noise ({p}), beside imperfections; an effect may be better."
        )
    text = f"What it leaves looks like noise: nothing is missing ({p})."
    return f"{text} {noise_text(check['noise_scale'])}" if check.get("noise_misstated") else text


def _otherwise(
    result: Mapping[str, Any], known: Mapping[str, Any], diagnosis: Mapping[str, Any] | None
) -> str:
    """The friction coefficients with what else explains the data, where they are others."""
    if diagnosis is None:
        return ""
    text, asked = "", diagnosis["verdict"]["effects"]
    for row in diagnosis["candidates"]:
        effects = row["effect"].split("+")
        if row["effect"] not in asked or set(effects) == set(result["effects"]):
            continue
        others = [
            f"{name} is {_value(other)}"
            for name, entry in known.items()
            if FRICTION.fullmatch(name) and (other := row.get("parameters", {}).get(name))
            if abs(other["mean"] - entry["mean"]) > OTHER_SDS * hypot(other["sd"], entry["sd"])
        ]
        if others:
            text += f"; with {listed(list(map(_words, effects)))} {listed(others)}"
    return text


def _gravity(check: Mapping[str, Any]) -> str:
    entry = check.get("gravity")
    if entry is None:
        return ""
    return f"Gravity, measured instead of taken as declared, is {_value(entry)}."


def unseen_text(check: Mapping[str, Any], diagnosis: Mapping[str, Any] | None = None) -> str:
    """The smallest strengths that would have shown, of what would change most in the result.

    Of compare.json, or of diagnosis.json where there is one.
    """
    found = (diagnosis or check).get("could_not_see") or {}
    asked, in_question = list(found), set(check.get("in_question", ()))
    if diagnosis is not None:
        in_question = {name for one in diagnosis["verdict"]["effects"] for name in one.split("+")}
        asked = [row["effect"] for row in diagnosis["candidates"]]
    told = {name: found[name] for name in asked if name not in in_question and name in found}
    parts = [
        _smaller(name, told[name], number, is_first=i == 0)
        for i, (name, number) in enumerate(_worst(told))
    ]
    return sentence(f"{listed(parts)} could not have been seen") if parts else ""


def _worst(told: Mapping[str, Any]) -> list[tuple[str, str | None]]:
    """Effects, and the number that each would change most: of every number the worst first.

    In its standard deviations, by an effect as strong as it usually is, if that could not have been
    seen. None: no number by more than its standard deviation.
    """
    sizes: dict[tuple[str, str | None], float] = {(name, None): 0.0 for name in told}
    for name, one in told.items():
        strength = one["strength"]
        share = 1.0 if strength is None else min(one.get("usual", strength) / strength, 1.0)
        for number, changed in one.get("changes", {}).items():
            sizes[name, number] = share * abs(changed["sds"])
    chosen: dict[str, str | None] = {}
    seen: set[str | None] = {None}
    in_turn = sorted(sizes, key=lambda pair: -sizes[pair])
    for is_new in (True, False):
        for name, number in in_turn:
            if name not in chosen and (not is_new or number not in seen):
                chosen[name] = number
                seen.add(number)
    return list(chosen.items())[:MOST_UNSEEN]


def _smaller(name: str, told: Mapping[str, Any], number: str | None, is_first: bool) -> str:
    """An effect that is weaker than its `strength`, in words; of any, where that is None."""
    strength = told["strength"]
    if strength is None:
        text = f"{_words(name)} of any usual strength"
    elif name in SHARES:
        text = f"{SHARES[name]} that is off by less than {_strength(name, told, strength)}"
    else:
        text = f"{_words(name)} below {_strength(name, told, strength)}"
    if number is None:
        return text
    what = number if FRICTION.fullmatch(number) else _words(number)
    changed = f"{what} by {two_figures(abs(told['changes'][number]['by']))}"
    if strength is None:
        return f"{text} ({_strength(name, told, told['usual'])} would change {changed})"
    return f"{text} ({'which would change ' if is_first else ''}{changed})"


def _strength(name: str, told: Mapping[str, Any], value: float) -> str:
    """A strength of an effect with its unit, or in per cent."""
    if name in SHARES:
        return f"{two_figures(100 * value)} %"
    return two_figures(value) + _unit(told["unit"])

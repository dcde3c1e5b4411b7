"""Diagnoses against the truth: what counts as right, for one case and for many."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from benchmarks import tables

Kind = Literal["none", "library", "exotic"]

LARGEST_SET = 3
BARS = {
    "covered": (">=", 0.95),
    "named_right": (">=", 0.75),
    "false_alarms": ("<=", 0.05),
    "unknown_recognised": (">=", 0.80),
    "confident_wrong_exotic": ("<=", 0.10),
    "mean_set_size": ("<=", 1.5),
    "noise_after_worst": ("<=", 1.10),
}
SERIES_BARS = {**BARS, "named_right": (">=", 0.90)}


@dataclass(frozen=True)
class Score:
    """One diagnosed case."""

    truth: frozenset[str]  # effects that are there
    kind: Kind  # nothing is there, all is in the library, or something is not ("exotic")
    label: str  # the verdict in a word or two: a column of the confusion matrix
    is_named_right: bool  # one hypothesis, the true one; of "none": that nothing is missing
    is_covered: bool  # named right, or ambiguous with the truth among at most three
    is_confident_wrong: bool  # one hypothesis, a wrong one; of "none": any alarm
    # that something is missing which cannot be named: unknown, ambiguous or a law
    is_recognised: bool
    set_size: float  # number of hypotheses reported; NaN where the truth is not among them
    # rms residual in units of the noise, without and with what was added
    before: float
    after: float


def judge(truth: str, library: Sequence[str], diagnosis: Mapping[str, Any]) -> Score:
    """Scores one diagnosis.

    Args:
      truth: "none", or names joined by "+", as in NAME.truth.json.
      library: the names that the diagnosis knew.
      diagnosis: what diagnosis.json holds (docs/reference/result_files.md).
    """
    there = frozenset() if truth == "none" else frozenset(truth.split("+"))
    kind: Kind = "none" if not there else "library" if there <= set(library) else "exotic"
    status, told = diagnosis["verdict"]["status"], diagnosis["verdict"]["effects"]
    match status:
        case "none":
            answers, label = [frozenset[str]()], "none"
        case "named":
            answers, label = [frozenset(told)], "+".join(sorted(told))
        case "ambiguous":
            answers = [frozenset(each.split("+")) for each in told]
            law = ["a law"] if diagnosis["verdict"].get("law") else []
            label = " or ".join([*sorted(told), *law])
        case "unknown" | "law":
            answers, label = [], status
        case _:
            raise ValueError(f"unknown status {status!r} in a diagnosis")
    is_right = status in ("none", "named") and answers == [there] and kind != "exotic"
    is_among = there in answers and kind != "exotic"
    history = diagnosis["history"]
    return Score(
        truth=there,
        kind=kind,
        label=label,
        is_named_right=is_right,
        is_covered=is_right or (is_among and len(answers) <= LARGEST_SET),
        is_confident_wrong=status != "none"
        if kind == "none"
        else (status == "named" and not is_right) or (status == "law" and kind == "library"),
        is_recognised=status in ("unknown", "ambiguous", "law"),
        set_size=len(answers) if is_among else math.nan,
        before=math.sqrt(history[0]["chi2_per_dof"]),
        after=math.sqrt(history[-1]["chi2_per_dof"]),
    )


def summary(scores: Sequence[Score]) -> dict[str, float]:
    """Rates over many cases; NaN where there are none of the kind."""
    plain, known, exotic = (
        [score for score in scores if score.kind == kind] for kind in ("none", "library", "exotic")
    )
    named = [score for score in known if score.is_named_right]
    return {
        "none": len(plain),
        "false_alarms": _rate(plain, lambda score: not score.is_named_right),
        "known": len(known),
        "named_right": _rate(known, lambda score: score.is_named_right),
        "covered": _rate(known, lambda score: score.is_covered),
        "mean_set_size": tables.mean(score.set_size for score in known),
        "confident_wrong": _rate(known, lambda score: score.is_confident_wrong),
        "missed": _rate(known, lambda score: score.label == "none"),
        "exotic": len(exotic),
        "unknown_recognised": _rate(exotic, lambda score: score.is_recognised),
        "confident_wrong_exotic": _rate(exotic, lambda score: score.is_confident_wrong),
        "noise_before": tables.mean(score.before for score in known),
        "noise_after": tables.mean(score.after for score in named),
        "noise_after_worst": max((score.after for score in named), default=math.nan),
    }


def confusion(scores: Sequence[Score]) -> dict[str, dict[str, int]]:
    """By truth, how often each verdict was given, the most frequent first."""
    rows: dict[str, Counter[str]] = {}
    for score in sorted(scores, key=lambda score: (score.kind, sorted(score.truth))):
        rows.setdefault("+".join(sorted(score.truth)) or "none", Counter())[score.label] += 1
    return {truth: dict(counts.most_common()) for truth, counts in rows.items()}


def missed_bars(figures: Mapping[str, float], is_series: bool) -> list[str]:
    """What falls short, in words; a figure that was not measured is no failure."""
    missed = []
    for name, (sign, bar) in (SERIES_BARS if is_series else BARS).items():
        value = figures[name]
        if value < bar if sign == ">=" else value > bar:
            missed.append(f"{name} {value:.3g}, {sign} {bar:g} wanted")
    return missed


def _rate(scores: Sequence[Score], is_so: Callable[[Score], bool]) -> float:
    return tables.mean(float(is_so(score)) for score in scores)

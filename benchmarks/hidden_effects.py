"""The exam of the diagnosis: clips in which an effect is hidden, and what it says of them.

    python -m benchmarks hidden_effects --out DIR              our own grid, tracks only
    python -m benchmarks hidden_effects FOLDER --out DIR       clips made elsewhere

The grid is effects x strengths x seeds, clips without an effect, and clips with effects that
the library does not have. Its truths come from an integrator of their own, with the small
faults of real clips. Every case goes through `galileo diagnose`; of those with an effect only
the ones count in which it shows (chi2 per degree of freedom of the base model above
--least-chi2). What is finished stays in DIR/results.jsonl and is not done again.
"""

import argparse
import json
import math
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import hidden_cases, tables, verdicts
from benchmarks.hidden_cases import Case
from benchmarks.journal import Journal
from galileo_jax.commands import command
from galileo_jax.runtime.errors import InputError

PIXELS_PER_METRE = 900.0
LEAST_CHI2 = 3.0  # of our own grid; clips from elsewhere all count
COLUMNS = ("right", "covered", "size", "before", "after", "seconds")
BY_COLUMNS = ("cases", "right", "covered", "size", "wrong", "missed", "unknown")
Scored = Sequence[tuple[Case, verdicts.Score]]


def main(call: argparse.Namespace) -> dict[str, Any]:
    library = hidden_cases.ramp_effects()
    cases = {case.name: case for case in _cases(call, library)}
    journal = Journal(call.out / "results.jsonl")
    least = LEAST_CHI2 * (call.folder is None) if call.least_chi2 is None else call.least_chi2
    tables.row("case", COLUMNS)
    told: list[tuple[Case, verdicts.Score]] = []
    seconds, failures = [], {}
    unmade = {name: None if name in journal.rows else (case,) for name, case in cases.items()}
    if call.folder:
        unmade = dict.fromkeys(cases)
    for name, _ in hidden_cases.made_meanwhile(hidden_cases.make_clips, unmade):
        case = cases[name]
        entry = journal.tried(name, lambda case=case: _examined(case, call))
        if entry["error"]:
            failures[name] = entry["error"]
            print(f"{name:<28} {entry['error']}", flush=True)
            continue
        told.append((case, verdicts.judge(case.effect, library, entry["diagnosis"])))
        seconds.append(entry["seconds"])
        _show(*told[-1], seconds[-1])
    weak = [(c, s) for c, s in told if s.kind != "none" and s.before**2 < least]
    scores = [one for one in told if one not in weak]
    if not scores:
        raise InputError(f"{call.out}: no case could be diagnosed in which the effect shows")
    figures = verdicts.summary([score for _, score in scores])
    report = {
        "cases": len(cases),
        "too_weak": len(weak),
        **figures,
        "seconds_median": float(np.median(seconds)),
        "seconds_worst": max(seconds),
        "too_weak_by_effect": _by(weak, lambda case: case.effect),
        "failures": failures,
        "by_effect": _by(scores, lambda case: case.effect),
        "by_strength": _by(scores, lambda case: case.strength),
        "confusion": verdicts.confusion([score for _, score in scores]),
    }
    _print(report)
    missed = verdicts.missed_bars(figures, bool(call.series))
    missed += [f"{name} cannot be diagnosed" for name in failures]
    return report | {"bars_missed": tables.missed(missed)}


def run_diagnosis(yamls: Sequence[Path], out: Path, seed: int) -> dict[str, Any]:
    """The diagnosis of clips, saved in `out` as `galileo diagnose` saves it."""
    from galileo_jax.api.diagnose import diagnose

    diagnose(list(yamls), seed=seed).save(out)
    return json.loads((out / "diagnosis.json").read_text())


def _cases(call: argparse.Namespace, library: Sequence[str]) -> list[Case]:
    if call.folder:
        return hidden_cases.folder_cases(call.folder, call.series, call.only)
    asked = call.effects.split(",") if call.effects else list(library)
    unknown = [name for name in asked if name not in library]
    if unknown:
        raise InputError(f"--effects: unknown {unknown[0]!r}; known: {', '.join(library)}")
    noise_m = call.noise_px / PIXELS_PER_METRE
    grid = (asked, call.strengths, call.seeds, call.none, noise_m, call.fps, call.series)
    return list(hidden_cases.grid(call.out / "clips", *grid))


def _examined(case: Case, call: argparse.Namespace) -> dict[str, Any]:
    """What a diagnosis says of a case, and the seconds it took, tracking apart."""
    yamls = case.yamls
    if call.tracks:
        yamls = [hidden_cases.tracked(path, call.tracks) for path in yamls]
    began = time.perf_counter()
    said = run_diagnosis(yamls, call.out / "runs" / case.name, call.seed)
    return {"diagnosis": said, "seconds": round(time.perf_counter() - began, 2)}


def _show(case: Case, score: verdicts.Score, seconds: float) -> None:
    size = None if math.isnan(score.set_size) else int(score.set_size)
    told = (score.is_named_right, score.is_covered, size, score.before, score.after, seconds)
    if score.kind == "exotic":
        told = (None, score.is_recognised, *told[2:])
    tables.row(case.name, told)
    print(f"{'':<28}  says {score.label}", flush=True)


def _by(scores: Scored, key: Callable[[Case], Any]) -> dict[str, dict[str, float]]:
    """The summary for every effect, or every strength."""
    groups: dict[str, list[verdicts.Score]] = {}
    for case, score in scores:
        if key(case) is not None:
            groups.setdefault(str(key(case)), []).append(score)
    return {name: verdicts.summary(group) for name, group in groups.items()}


def _print(report: Mapping[str, Any]) -> None:
    for title in ("by_effect", "by_strength", "too_weak_by_effect"):
        print()
        tables.row(title.replace("_", " "), BY_COLUMNS)
        for name, entry in report[title].items():
            tables.row(name, _cells(entry))
    print("\nconfusion: truth, and what was said")
    for truth, row in report["confusion"].items():
        print(f"{truth:<28}  " + ", ".join(f"{label} {count}" for label, count in row.items()))
    print()
    tables.summary(report)


def _cells(entry: Mapping[str, float]) -> list[float]:
    cases = entry["none"] + entry["known"] + entry["exotic"]
    right = 1 - entry["false_alarms"] if entry["none"] else entry["named_right"]
    wrong = entry["false_alarms"] if entry["none"] else entry["confident_wrong"]
    if entry["exotic"] and not entry["known"]:
        wrong = entry["confident_wrong_exotic"]
    values = (right, entry["covered"], entry["mean_set_size"], wrong, entry["missed"])
    return [cases, *values, entry["unknown_recognised"]]


def options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("folder", type=Path, nargs="?", help="clips with truths; absent = our own grid")
    add("--out", type=Path, required=True, help="clips, runs and results are kept there")
    add("--series", type=command.whole_number(2), help="so many clips are diagnosed together")
    add("--least-chi2", type=float, help="of the base model (3 for the grid, 0 for FOLDER)")
    add("--seed", type=command.whole_number(0), default=0, help="of the diagnosis")
    ours = parser.add_argument_group("our own grid")
    ours.add_argument("--effects", help="a,b (default: the whole library)")
    ours.add_argument("--strengths", type=float, nargs="+", default=[0.2, 0.5, 0.8])
    ours.add_argument("--seeds", type=command.whole_number(0), default=2)
    ours.add_argument("--none", type=command.whole_number(0), default=20, help="clips without")
    ours.add_argument("--noise-px", type=float, default=0.3, help="at 900 px/m")
    ours.add_argument("--fps", type=float, default=30.0)
    theirs = parser.add_argument_group("clips in FOLDER")
    theirs.add_argument("--only", default="*", help="glob over clip names")
    theirs.add_argument("--tracks", type=Path, help="keep tracks there; reuse what is there")

"""The exam of the diagnosis: clips in which an effect is hidden, and what it says of them.

    python -m benchmarks hidden_effects --out DIR              our own grid, tracks only
    python -m benchmarks hidden_effects FOLDER --out DIR       clips made elsewhere

The grid is effects x strengths x seeds, clips without an effect, and clips with effects that
the library does not have. Its truths come from an integrator of their own, with the small
faults of real clips. Every case goes through `galileo diagnose`; of those with an effect only
the ones count in which it shows (chi2 per degree of freedom of the base model above
--least-chi2: 3, of clips made elsewhere 0). `--series N` diagnoses N clips together.
What is finished stays in DIR/results.jsonl and is not done again.
"""

import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import hidden_cases, tables, verdicts
from benchmarks.hidden_cases import Case
from benchmarks.journal import Journal
from galileo_jax.runtime.errors import InputError

PIXELS_PER_METRE = 900.0
LEAST_CHI2 = 3.0  # of our own grid; clips from elsewhere all count
COLUMNS = ("right", "covered", "size", "before", "after", "seconds")
Scored = Sequence[tuple[Case, verdicts.Score]]


def main(
    folder: Path | None = None,
    *,
    out: Path,
    series: int | None = None,
    least_chi2: float | None = None,
    seed: int = 0,
    effects: str | None = None,
    strengths: tuple[float, ...] = (0.2, 0.5, 0.8),
    seeds: int = 2,
    none: int = 20,
    noise_px: float = 0.3,
    fps: float = 30.0,
    only: str = "*",
) -> dict[str, Any]:
    library = hidden_cases.ramp_effects()
    if folder:
        listed = hidden_cases.folder_cases(folder, series, only)
    else:
        asked = effects.split(",") if effects else library
        if unknown := set(asked) - set(library):
            raise InputError(f"--effects: unknown {unknown}; known: {', '.join(library)}")
        grid = (asked, strengths, seeds, none, noise_px / PIXELS_PER_METRE, fps, series)
        listed = list(hidden_cases.grid(out / "clips", *grid))
    cases = {case.name: case for case in listed}
    journal = Journal(out / "results.jsonl")
    least = LEAST_CHI2 * (folder is None) if least_chi2 is None else least_chi2
    tables.row("case", COLUMNS)
    told: list[tuple[Case, verdicts.Score]] = []
    seconds, failures = [], {}
    unmade = {name: None if name in journal.rows else (case,) for name, case in cases.items()}
    if folder:
        unmade = dict.fromkeys(cases)
    for name, _ in hidden_cases.made_meanwhile(hidden_cases.make_clips, unmade):
        case = cases[name]
        entry = journal.tried(name, lambda case=case: _examined(case, out, seed))
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
        raise InputError(f"{out}: no case could be diagnosed in which the effect shows")
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
    print("\nconfusion: truth, and what was said")
    for truth, row in report["confusion"].items():
        print(f"{truth:<28}  " + ", ".join(f"{label} {count}" for label, count in row.items()))
    tables.summary(report)
    missed = verdicts.missed_bars(figures, bool(series))
    missed += [f"{name} cannot be diagnosed" for name in failures]
    return report | {"bars_missed": tables.missed(missed)}


def run_diagnosis(yamls: Sequence[Path], out: Path, seed: int) -> dict[str, Any]:
    """The diagnosis of clips, saved in `out` as `galileo diagnose` saves it."""
    from galileo_jax.api.diagnose import diagnose

    diagnose(list(yamls), seed=seed).save(out)
    return json.loads((out / "diagnosis.json").read_text())


def _examined(case: Case, out: Path, seed: int) -> dict[str, Any]:
    """What a diagnosis says of a case, and the seconds it took."""
    began = time.perf_counter()
    said = run_diagnosis(case.yamls, out / "runs" / case.name, seed)
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

"""Are the probabilities of a diagnosis right? Hidden effects, half of them outside the library.

    python benchmarks/reliability.py --out DIR --num 300

Draws tracks (ramp angle, objects, strength, noise and frame rate at random, the truth from an
integrator of its own with the small faults of real clips): of four, two hide an effect that the
library does not have, one hides one of the library's and one hides two. An effect that leaves no
trace (static friction where a push starts the motion; a wrong scale that friction makes up for) is
not counted. Every verdict that names effects (`named`, `ambiguous`) is a claim with a probability
for each hypothesis; the reliability curve compares the probabilities with how often the hypothesis
was the truth. What is finished stays in DIR/results.jsonl and is not done again. The last line is
JSON.
"""

import argparse
import json
import multiprocessing
import zlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import hidden_cases
import hidden_effects
import numpy as np
import tables
import verdicts

from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.model.parameters import inverse
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.precision import in_float64

KINDS = ("outside", "one", "outside", "two")
EDGES = np.linspace(0.0, 1.0, 11)
FRAME_RATES = (30.0, 60.0, 120.0)
NOISE_M = (0.1e-3, 0.4e-3)
ANGLES_DEG = (8.0, 30.0)
STRENGTHS = (0.3, 1.0)
TRIES = 8  # not every effect has a place in every scene


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    library = effect_names()
    call.out.mkdir(parents=True, exist_ok=True)
    done = _results(call.out / "results.jsonl")
    tables.row("case", ("kind", "truth", "says"))
    entries = []
    cases = {f"case{i}": KINDS[i % len(KINDS)] for i in range(call.first, call.first + call.num)}
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        made = {
            name: pool.submit(make_clip, call.out / "clips", name, kind, library)
            for name, kind in cases.items()
        }
        for name, kind in cases.items():
            made[name].result()  # raises what `simulate` raised
            if name not in done:
                done[name] = _examine(call.out, name, kind)
            entries.append(done[name])
            says = done[name]["diagnosis"]["verdict"] if done[name]["diagnosis"] else {}
            words = f"{says.get('status')} {' | '.join(says.get('effects', ()))}"
            tables.row(name, (done[name]["kind"], done[name]["truth"], words))
    figures = summary([entry for entry in entries if entry["diagnosis"]], library)
    figures["tracebacks"] = [entry["error"] for entry in entries if not entry["diagnosis"]]
    _print(figures)
    tables.finish("reliability", figures)
    return None


def draw(folder: Path, name: str, kind: str, library: Sequence[str], attempt: int) -> dict:
    """What `simulate` is asked for; the same name, the same draw."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), attempt])
    pool = hidden_cases.EXOTICS if kind == "outside" else library
    effects = rng.choice(pool, 2 if kind == "two" else 1, replace=False)
    return {
        "out": folder / f"{name}.csv",
        "track_only": True,
        "solver": "fine",
        "faults": True,
        "seed": int(rng.integers(2**31)),
        "angle": float(rng.uniform(*ANGLES_DEG)),
        "track_noise": float(rng.uniform(*NOISE_M)),
        "fps": float(rng.choice(FRAME_RATES)),
        "strength": float(rng.uniform(*STRENGTHS)),
        "effects": {str(effect): {} for effect in effects},
        "effects_from": [hidden_cases.EXOTIC_FILE] if kind == "outside" else (),
    }


def make_clip(folder: Path, name: str, kind: str, library: Sequence[str]) -> None:
    """Simulates a case unless it is there; an effect without a place in the scene is drawn again.

    Runs in a process of its own, so that effects from outside stay unknown to the diagnosis.
    """
    for attempt in range(TRIES):
        if (folder / f"{name}.truth.json").is_file():
            return
        try:
            hidden_cases.make_clips(draw(folder, name, kind, library, attempt))
        except InputError:
            continue


def seen_truth(traces: Mapping[str, float]) -> str:
    """The hidden effects that leave a trace in a track, joined by +; none: "none"."""
    return "+".join(name for name, nats in traces.items() if nats > 0) or "none"


@in_float64
def traces(yaml: Path, kind: str) -> dict[str, float]:
    """By how many nats the track's evidence is better with all hidden effects than without each.

    Without one: with all others, or with none, whichever is better.

    The fit with all is looked for from the truth, too, so that no narrow valley hides one. What is
    outside the library always leaves one: infinite.
    """
    record = json.loads(yaml.with_suffix(".truth.json").read_text())
    hidden = tuple(record["effect"].split("+"))
    if kind == "outside":
        return {record["effect"]: np.inf}
    clip = load_clip(yaml)
    observation = measure(clip).observation
    trials = make_joint_problem([clip], [observation], effects=make_effects(hidden))
    fitter = GradientFitter(trials)
    values = record | record["effect_parameters"] | record["nuisances"]
    parameters = trials.model_parameters
    truth = inverse(parameters, np.array([values.get(p.name, p.absent) for p in parameters]))
    free = trials.free(hidden)[: len(parameters)]
    (beside,) = fitter.fit_from(np.where(free, truth, 0.0)[None], free[None], np.zeros(1, int))
    whole = max(fitter.fit(0, effects=hidden).log_evidence, beside.log_evidence)
    without = {name: tuple(other for other in hidden if other != name) for name in hidden}
    evidence = {rest: fitter.fit(0, effects=rest).log_evidence for rest in {(), *without.values()}}
    less = {name: max(evidence[rest], evidence[()]) for name, rest in without.items()}
    return {name: whole - less[name] for name in hidden}


def _examine(out: Path, name: str, kind: str) -> dict[str, Any]:
    entry: dict[str, Any] = {"case": name, "kind": kind, "diagnosis": None, "error": None}
    yaml = out / "clips" / f"{name}.yaml"
    found = traces(yaml, kind)
    entry["truth"] = seen_truth(found)
    entry["traces_nats"] = {name: nats for name, nats in found.items() if np.isfinite(nats)}
    try:
        run = hidden_effects.run_diagnosis([yaml], out / "runs" / name, 0)
        keys = ("verdict", "probability_none", "history", "p_value")
        brief = ("effect", "probability", "log_evidence", "p_value")
        entry["diagnosis"] = {key: run.get(key) for key in keys}
        entry["diagnosis"]["candidates"] = [
            {key: candidate[key] for key in brief} for candidate in run["candidates"][:12]
        ]
    except Exception as error:  # one case must not end hours of others; it is reported
        entry["error"] = f"{type(error).__name__}: {error}"
    with (out / "results.jsonl").open("a") as file:
        file.write(json.dumps(entry) + "\n")
    return entry


def summary(entries: Sequence[Mapping[str, Any]], library: Sequence[str]) -> dict[str, Any]:
    """The curve, its expected calibration error, and the rates that the docs state."""
    claims = [claim for entry in entries for claim in _claims(entry, library)]
    probability, is_true = (np.array([c[i] for c in claims], float) for i in range(2))
    place = np.clip(np.digitize(probability, EDGES) - 1, 0, len(EDGES) - 2)
    curve = [
        (float(probability[place == b].mean()), float(is_true[place == b].mean()), int(count))
        for b, count in enumerate(np.bincount(place, minlength=len(EDGES) - 1))
        if count
    ]
    scored = [(e, verdicts.judge(e["truth"], library, e["diagnosis"])) for e in entries]
    ambiguous = [(e, s) for e, s in scored if e["diagnosis"]["verdict"]["status"] == "ambiguous"]
    inside = [s for e, s in scored if e["kind"] != "outside"]
    outside = [s for e, s in scored if e["kind"] == "outside"]
    return {
        "cases": len(scored),
        "claims": len(claims),
        "curve": curve,
        "expected_calibration_error": sum(abs(p - share) * n for p, share, n in curve)
        / max(len(claims), 1),
        "ambiguous": len(ambiguous),
        "ambiguous_inside": sum(e["kind"] != "outside" for e, _ in ambiguous),
        "ambiguous_inside_holds_truth": _mean(
            [s.set_size == s.set_size for e, s in ambiguous if e["kind"] != "outside"]
        ),
        "wrong_inside": _mean([s.is_confident_wrong for s in inside]),
        "wrong_outside": _mean([s.is_confident_wrong for s in outside]),
        "statuses": {
            kind: _counts(
                [e["diagnosis"]["verdict"]["status"] for e in entries if e["kind"] == kind]
            )
            for kind in sorted(set(KINDS))
        },
        "named_wrong": [
            f"{e['case']}: {e['truth']} named {s.label}; {_weakest(e)}"
            for e, s in scored
            if s.is_confident_wrong
        ],
    }


def _claims(entry: Mapping[str, Any], library: Sequence[str]) -> list[tuple[float, bool]]:
    """Of every hypothesis in a verdict its probability, and whether it is the truth.

    A form without a name, and a law, say that it is something outside of the library, and no more.
    """
    diagnosis, truth = entry["diagnosis"], set(entry["truth"].split("+"))
    is_outside = not truth <= {*library, "none"}
    verdict = diagnosis["verdict"]
    if verdict["status"] not in ("named", "ambiguous"):
        return []
    named = verdict["status"] == "named"
    answers = ["+".join(verdict["effects"])] if named else verdict["effects"]
    odds = {frozenset(c["effect"].split("+")): c["probability"] for c in diagnosis["candidates"]}
    if verdict.get("law"):
        laws = [c["effect"] for c in diagnosis["candidates"] if c["effect"].startswith("law_")]
        answers = [*answers, *laws[:1]]
    parts = [frozenset(each.split("+")) for each in answers]
    return [
        (odds.get(each, 0.0), each == truth if each <= {*library} else is_outside) for each in parts
    ]


def _weakest(entry: Mapping[str, Any]) -> str:
    """Of the effects that are there the one that shows least."""
    shown = {n: x for n, x in entry.get("traces_nats", {}).items() if n in entry["truth"]}
    if not shown:
        return "outside the library"
    least = min(shown, key=shown.__getitem__)
    return f"{least} shows by {shown[least]:.1f} nats"


def _counts(statuses: Sequence[str]) -> dict[str, int]:
    return {status: statuses.count(status) for status in sorted(set(statuses))}


def _mean(values: Sequence[bool]) -> float:
    return float(np.mean(values)) if values else float("nan")


def _results(path: Path) -> dict[str, Any]:
    lines = path.read_text().splitlines() if path.is_file() else []
    entries = [json.loads(line) for line in lines if line.endswith("}")]
    return {entry["case"]: entry for entry in entries if not entry["error"]}


def _print(figures: Mapping[str, Any]) -> None:
    tables.row("claimed probability", ("true", "claims"))
    for probability, share, count in figures["curve"]:
        tables.row(f"{probability:.3f}", (share, count))
    for name, value in figures.items():
        if isinstance(value, int | float):
            tables.row(name, [value])
    for line in (*figures["named_wrong"], *figures["tracebacks"], figures["statuses"]):
        print(line)


def _parser() -> command.Parser:
    parser = command.Parser(prog="reliability.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--out", type=Path, required=True, help="tracks, runs and results")
    parser.add_argument("--num", type=command.whole_number(1), default=300, help="tracks")
    parser.add_argument("--first", type=command.whole_number(0), default=0, help="number of case")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

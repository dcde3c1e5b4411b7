"""Are the probabilities of a diagnosis right? Hidden effects, half of them outside the library.

    python -m benchmarks reliability --out DIR --num 300

Draws tracks (ramp angle, objects, strength, noise and frame rate at random, the truth from an
integrator of its own with the small faults of real clips): of four, two hide an effect that the
library does not have, one hides one of the library's and one hides two. An effect that leaves no
trace (static friction where a push starts the motion; a wrong scale that friction makes up for) is
not counted. Every verdict that names effects (`named`, `ambiguous`) is a claim with a probability
for each hypothesis; the reliability curve compares the probabilities with how often the hypothesis
was the truth. All figures are given twice: with every effect counted that leaves any trace, and
with only those that must be said (by more than 3 nats, the factor of 20 that a name needs), where a
weaker one may be said or not. What is finished stays in DIR/results.jsonl and is not done again.

"""

import contextlib
import itertools
import json
import math
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import hidden_cases, hidden_effects, tables, verdicts
from benchmarks.journal import Journal
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.comparison.compare import ADEQUATE_P
from galileo_jax.diagnosis.thresholds import DECISIVE
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.forms import FORM_NAMES
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.model.parameters import inverse
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit

KINDS = ("outside", "one", "outside", "two")
EDGES = np.linspace(0.0, 1.0, 11)
FRAME_RATES = (30.0, 60.0, 120.0)
NOISE_M = (0.1e-3, 0.4e-3)
ANGLES_DEG = (8.0, 30.0)
STRENGTHS = (0.3, 1.0)
SECOND = "second_possible"  # the rule: an effect may be there, too weak to be told
TRIES = 8  # not every effect has a place in every scene
NUM_DRAWN = 1000  # of the claims, for the error that right ones have


def main(*, out: Path, num: int = 300, first: int = 0) -> dict[str, Any]:
    library = effect_names()
    journal = Journal(out / "results.jsonl")
    tables.row("case", ("kind", "truth", "says"))
    entries = []
    kinds = {f"case{i}": KINDS[i % len(KINDS)] for i in range(first, first + num)}
    asked = {name: (out / "clips", name, kind, library) for name, kind in kinds.items()}
    for name, is_made in hidden_cases.made_meanwhile(make_clip, asked):
        if not is_made:
            tables.row(name, (kinds[name], "", "not made: none of the effects drawn has a place"))
            continue
        entry = journal.tried(name, lambda name=name: _examined(out, name, kinds[name]))
        entries.append(entry)
        says = entry["diagnosis"]["verdict"] if not entry["error"] else {"status": entry["error"]}
        words = f"{says['status']} {' | '.join(says.get('effects', ()))}"
        tables.row(name, (kinds[name], entry.get("truth", ""), words))
    said = [entry for entry in entries if not entry["error"]]
    figures = summary(said, library)
    _print(figures)
    print(f"\nWhat shows by more than {DECISIVE:g} nats must be said, weaker effects may be:")
    figures["if_it_shows"] = summary(said, library, DECISIVE)
    _print(figures["if_it_shows"])
    return figures | {"failed": [entry["error"] for entry in entries if entry["error"]]}


def draw(folder: Path, name: str, kind: str, library: Sequence[str], attempt: int) -> dict:
    """What `simulate` is asked for; the same name, the same draw."""
    rng = np.random.default_rng([zlib.crc32(name.encode()), attempt])
    pool = hidden_cases.EXOTICS if kind == "outside" else library
    effects = rng.choice(pool, 2 if kind == "two" else 1, replace=False)
    return {
        "out": folder / f"{name}.csv",
        **hidden_cases.TRACK,
        "seed": int(rng.integers(2**31)),
        "angle": float(rng.uniform(*ANGLES_DEG)),
        "track_noise": float(rng.uniform(*NOISE_M)),
        "fps": float(rng.choice(FRAME_RATES)),
        "strength": float(rng.uniform(*STRENGTHS)),
        "effects": {str(effect): {} for effect in effects},
        "effects_from": [hidden_cases.EXOTIC_FILE] if kind == "outside" else (),
    }


def make_clip(folder: Path, name: str, kind: str, library: Sequence[str]) -> bool:
    """Simulates a case unless it is there; an effect without a place in the scene is drawn again.

    Returns whether that came to a case; all else that `simulate` raises is raised.
    """
    truth = folder / f"{name}.truth.json"
    for attempt in range(0 if truth.is_file() else TRIES):
        with contextlib.suppress(InputError):
            simulate(**draw(folder, name, kind, library, attempt))
            break
    return truth.is_file()


def right_answers(entry: Mapping[str, Any], least: float) -> list[str]:
    """What may be said of a case: the effects that must be said first, with some that may be.

    Args:
      entry: of the journal.
      least: nats by which an effect shows that must be said; one that shows less may be.
    """
    if not least or entry["kind"] == "outside":
        return [entry["truth"]]
    shows = entry["traces_nats"]
    must = [name for name, nats in shows.items() if nats > least]
    may = [name for name, nats in shows.items() if 0 < nats <= least]
    some = itertools.chain.from_iterable(
        itertools.combinations(may, size) for size in range(len(may) + 1)
    )
    return ["+".join((*must, *more)) or "none" for more in some]


def judged(entry: Mapping[str, Any], library: Sequence[str], least: float) -> verdicts.Score:
    """The score of a case, by that of its right answers that is nearest to what was said."""
    scores = [verdicts.judge(t, library, entry["diagnosis"]) for t in right_answers(entry, least)]
    return max(scores, key=lambda s: (s.is_named_right, not math.isnan(s.set_size)))


@in_float64
def traces(yaml: Path, kind: str) -> tuple[dict[str, float], float]:
    """By how many nats the track's evidence is better with all hidden effects than without each.

    Without one: with all others, or with none, whichever is better.

    All fits are looked for from the truth, too, so that no narrow valley hides one, or seems to
    show one. What is outside the library always leaves one: infinite.

    Returns:
      By effect, and of all over none: what the truth must have in a table in which it was found.
    """
    record = json.loads(yaml.with_suffix(".truth.json").read_text())
    hidden = tuple(record["effect"].split("+"))
    if kind == "outside":
        return {record["effect"]: np.inf}, np.inf
    clip = load_clip(yaml)
    observation = measure(clip).observation
    trials = make_joint_problem([clip], [observation], effects=make_effects(hidden))
    fitter = GradientFitter(trials)
    values = record | record["effect_parameters"] | record["nuisances"]
    parameters = trials.model_parameters
    truth = inverse(parameters, np.array([values.get(p.name, p.absent) for p in parameters]))

    def evidence_of(effects: tuple[str, ...]) -> float:
        free = trials.free(effects)[: len(parameters)]
        (beside,) = fitter.fit_from(np.where(free, truth, 0.0)[None], free[None], np.zeros(1, int))
        return max(best_fit(fitter, 0, effects=effects).log_evidence, beside.log_evidence)

    whole = evidence_of(hidden)
    without = {name: tuple(other for other in hidden if other != name) for name in hidden}
    evidence = {rest: evidence_of(rest) for rest in {(), *without.values()}}
    less = {name: max(evidence[rest], evidence[()]) for name, rest in without.items()}
    return {name: whole - less[name] for name in hidden}, whole - evidence[()]


def _examined(out: Path, name: str, kind: str) -> dict[str, Any]:
    """What is hidden in a case and shows, and what a diagnosis says of it."""
    yaml = out / "clips" / f"{name}.yaml"
    found, whole = traces(yaml, kind)
    run = hidden_effects.run_diagnosis([yaml], out / "runs" / name, 0)
    keys = ("verdict", "reasons", "probability_none", "history", "p_value")
    brief = ("effect", "law", "probability", "log_evidence", "log_prior", "p_value")
    table = [{key: candidate[key] for key in brief} for candidate in run["candidates"]]
    return {
        "kind": kind,
        "truth": "+".join(name for name, nats in found.items() if nats > 0) or "none",
        "truth_nats": whole if np.isfinite(whole) else None,
        "traces_nats": {name: nats for name, nats in found.items() if np.isfinite(nats)},
        "diagnosis": {key: run.get(key) for key in keys} | {"candidates": table},
    }


def summary(
    entries: Sequence[Mapping[str, Any]], library: Sequence[str], least: float = 0.0
) -> dict[str, Any]:
    """The curve, its expected calibration error, and the rates that the docs state.

    Args:
      entries: of the journal.
      library: names of its effects.
      least: nats by which an effect shows that must be said.
    """
    claims = [claim for entry in entries for claim in _claims(entry, library, least)]
    probability, is_true = (np.array([c[i] for c in claims], float) for i in range(2))
    scored = [(e, judged(e, library, least)) for e in entries]
    ambiguous = [(e, s) for e, s in scored if e["diagnosis"]["verdict"]["status"] == "ambiguous"]
    inside = [s for e, s in scored if e["kind"] != "outside"]
    outside = [s for e, s in scored if e["kind"] == "outside"]
    unheld = [(e, s) for e, s in ambiguous if e["kind"] != "outside" and math.isnan(s.set_size)]
    num_inside = sum(e["kind"] != "outside" for e, _ in ambiguous)
    return {
        "cases": len(scored),
        "claims": len(claims),
        "curve": curve(probability, is_true),
        "expected_calibration_error": calibration_error(probability, is_true),
        "of_right_claims": _error_if_right(probability),
        "ambiguous": len(ambiguous),
        "ambiguous_inside": num_inside,
        "ambiguous_inside_holds_truth": 1 - len(unheld) / num_inside if num_inside else math.nan,
        "named_right_inside": tables.mean(s.is_named_right for s in inside),
        "wrong_inside": tables.mean(s.is_confident_wrong for s in inside),
        "wrong_outside": tables.mean(s.is_confident_wrong for s in outside),
        "statuses": {
            kind: dict(
                Counter(e["diagnosis"]["verdict"]["status"] for e in entries if e["kind"] == kind)
            )
            for kind in sorted(set(KINDS))
        },
        "named_wrong": [_told(e, s) for e, s in scored if s.is_confident_wrong],
        "ambiguous_without_truth": [_told(e, s) for e, s in unheld],
    }


def _told(entry: Mapping[str, Any], score: verdicts.Score) -> str:
    """A case in a line: truth, verdict, and by how much the weakest effect shows."""
    shown = {n: x for n, x in entry.get("traces_nats", {}).items() if n in entry["truth"]}
    least = min(shown, key=shown.__getitem__) if shown else None
    weakest = f"{least} shows by {shown[least]:.1f} nats" if least else "outside the library"
    return f"{entry['case']}: {entry['truth']}, said {score.label}; {weakest}"


def curve(probability: np.ndarray, is_true: np.ndarray) -> list[tuple[float, float, int]]:
    """Of each class of claims the mean probability, the share that is true, and how many.

    Args:
      probability: `[claim]`.
      is_true: `[claim]`, 0 or 1.
    """
    place = np.clip(np.digitize(probability, EDGES) - 1, 0, len(EDGES) - 2)
    return [
        (float(probability[place == b].mean()), float(is_true[place == b].mean()), int(count))
        for b, count in enumerate(np.bincount(place, minlength=len(EDGES) - 1))
        if count
    ]


def calibration_error(probability: np.ndarray, is_true: np.ndarray) -> float:
    """Mean distance of claimed probability and share of truth, over the classes; 0 is best."""
    classes = curve(probability, is_true)
    return sum(abs(p - share) * n for p, share, n in classes) / max(len(probability), 1)


def _error_if_right(probability: np.ndarray) -> tuple[float, float]:
    """The calibration error of so many claims if all were right: the mean, and 95 % are below."""
    rng = np.random.default_rng(0)
    drawn = rng.random((NUM_DRAWN, len(probability))) < probability
    errors = [calibration_error(probability, each.astype(float)) for each in drawn]
    return float(np.mean(errors)), float(np.quantile(errors, 0.95))


def _claims(
    entry: Mapping[str, Any], library: Sequence[str], least: float
) -> list[tuple[float, bool]]:
    """Of every hypothesis in a verdict its probability, and whether it is the truth.

    The probability is that among the hypotheses that the data do not contradict: a verdict is on
    these alone.

    A form without a name, and a law, say that it is something outside of the library, and no more:
    all of the table are one claim. Where every effect counts, one that is named is all there is
    only as far as the diagnosis says that no second one may be there unseen.
    """
    diagnosis = entry["diagnosis"]
    verdict, table = diagnosis["verdict"], diagnosis["candidates"]
    if verdict["status"] not in ("named", "ambiguous", "law"):
        return []
    truths = [frozenset(each.split("+")) for each in right_answers(entry, least)]
    is_outside = not truths[0] <= {*library, "none"}
    is_one = verdict["status"] == "named"
    answers = ["+".join(verdict["effects"])] if is_one else verdict["effects"]
    parts = [frozenset(each.split("+")) for each in answers]
    named = [each for each in parts if each <= {*library}]
    left = _not_contradicted(diagnosis)
    odds = {frozenset(c["effect"].split("+")): c["probability"] / left for c in table}
    unseen = [w["probability"] for w in diagnosis.get("reasons", ()) if w["rule"] == SECOND]
    seen = 1.0 if least or not unseen else 1.0 - unseen[0]
    claims = [(seen * odds.get(each, 0.0), each in truths) for each in named]
    if verdict["status"] == "law" or verdict.get("law") or len(named) < len(parts):
        unnamed = [
            c["probability"]
            for c in table
            if (c["effect"].startswith("law_") or {*c["effect"].split("+")} & {*FORM_NAMES})
            and (c.get("p_value") or 1.0) >= ADEQUATE_P
        ]
        claims.append((min(sum(unnamed) / left, 1.0), is_outside))
    return claims


def _not_contradicted(diagnosis: Mapping[str, Any]) -> float:
    """The probability of all that the data do not contradict, as far as it was compared."""
    p_values = [(c["probability"], c.get("p_value")) for c in diagnosis["candidates"]]
    p_values.append((diagnosis.get("probability_none", 0.0), diagnosis.get("p_value")))
    return 1.0 - sum(p for p, by_data in p_values if by_data is not None and by_data < ADEQUATE_P)


def _print(figures: Mapping[str, Any]) -> None:
    tables.row("claimed probability", ("true", "claims"))
    for probability, share, count in figures["curve"]:
        tables.row(f"{probability:.3f}", (share, count))
    tables.summary(figures)
    tables.row("of_right_claims", figures["of_right_claims"])
    for key in ("named_wrong", "ambiguous_without_truth"):
        print(f"{key}:", *figures[key], sep="\n  ")
    print(figures["statuses"])

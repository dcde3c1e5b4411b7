"""Are laws found that nobody wrote down before? `python -m benchmarks laws --out DIR`.

Tracks with one of 24 hidden laws (`hidden_laws.py`), with an effect of the library, and with
nothing, go through the diagnosis, one clip or several. Right: the verdict is a law with the right
variables, and an exponent within 0.25 where the truth is a power. PySINDy, where it is installed,
gets the same missing accelerations with powers of t, q and v to choose from. With `--candidates`
only these of the library (and the forms) stand against the laws, which takes less time. What is
finished stays in DIR/results.jsonl.
"""

import argparse
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import journal
from benchmarks.hidden_cases import ANGLES_DEG
from benchmarks.hidden_laws import LAWS
from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.diagnosis.diagnose import diagnose
from galileo_jax.diagnosis.diagnosis import Diagnosis, Law
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.forms import FORMS
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.runtime.precision import in_float64

LIBRARY = ("air_drag", "constant_force", "friction_patch", "viscous_drag")
NO_LAW = "none"
NOISE_M = 0.3 / 900.0
EXPONENT = 0.25


def main(call: argparse.Namespace) -> dict[str, Any]:
    call.out.mkdir(parents=True, exist_ok=True)
    log = call.out / "results.jsonl"
    done = journal.finished(log)
    names = call.only or [*LAWS, *LIBRARY, NO_LAW]
    rows = []
    for i, name in enumerate(names):
        case = f"{name}_{call.clips}_{call.seed + i}"
        if case not in done:
            done[case] = {"case": case, **_one(call, name, call.seed + i)}
            journal.add(log, done[case])
        rows.append(done[case])
        _show(rows[-1])
    hidden = [row for row in rows if row["name"] in LAWS]
    others = [row for row in rows if row["name"] not in LAWS]
    seen = [row for row in hidden if row["chi2_before"] > 1.5]
    laws = [row for row in hidden if row["status"] == "law"]
    report = {
        "num": len(hidden),
        "seen": len(seen),
        "right": _share(row["right"] for row in seen),
        "wrong_claims": _share(row["status"] == "law" and not row["right"] for row in hidden),
        "named_wrongly": _share(row["status"] == "named" for row in seen),
        "best_formula_right": _share(row["best_right"] for row in seen if row["formulas"]),
        "chi2_after": [row["chi2_after"] for row in laws if row["right"]],
        "law_where_none": _share(row["status"] == "law" for row in others),
        "num_others": len(others),
        "pysindy_right": _share(
            row["pysindy_right"] for row in seen if row["pysindy_right"] is not None
        ),
        "cpu_s": float(np.median([row["cpu_s"] for row in rows])),
        "clips": call.clips,
        "seed": call.seed,
        "candidates": call.candidates or "library",
    }
    return report


def _share(values: Any) -> float | None:
    found = [bool(value) for value in values]
    return float(np.mean(found)) if found else None


@in_float64
def _one(call: argparse.Namespace, name: str, seed: int) -> dict[str, Any]:
    effect = f"hidden_{name}" if name in LAWS else name
    path = call.out / f"{name}_{call.clips}_{seed}.csv"
    several = {"series": call.clips} if call.clips > 1 else {}
    simulate(
        path,
        effects={} if name == NO_LAW else {effect: {}},
        strength=None if name == NO_LAW else 0.5,
        seed=seed,
        angle=ANGLES_DEG[seed % 3],
        track_only=True,
        track_noise=NOISE_M,
        fps=30.0,
        solver="fine",
        faults=True,
        **several,
    )
    files = [path.with_name(f"{path.stem}_{i + 1}.yaml") for i in range(call.clips)]
    clips = [load_clip(file) for file in (files if several else [path.with_suffix(".yaml")])]
    library = [each for each in effect_names() if not each.startswith(("hidden_", "law_"))]
    chosen = [each for each in library if each in (call.candidates or library)]

    def problem_with(names: Sequence[str]) -> Any:
        seen = [measure(clip).observation for clip in clips]
        return make_joint_problem(clips, seen, "auto", (*make_effects(names), *FORMS))

    trials = problem_with(chosen)
    if absent := trials.without_place():
        trials = problem_with([each for each in chosen if each not in absent])
    began = time.process_time()
    found = diagnose(trials, seed=0)
    laws = [c for c in found.candidates if c.law is not None]
    best = laws[0] if laws else None
    row: dict[str, Any] = {
        "name": name,
        "cpu_s": time.process_time() - began,
        "status": found.verdict.status,
        "effects": list(found.verdict.effects),
        "formulas": [c.law.text for c in laws if c.law is not None],
        "log_odds": [c.log_odds for c in found.candidates],
        "table": [c.name for c in found.candidates],
        "p": [c.p_value for c in found.candidates],
        "reasons": [why.sentence for why in found.verdict.reasons],
        "chi2_before": found.rounds[0].comparison.error["chi2_per_dof"],
        "chi2_after": found.rounds[-1].comparison.error["chi2_per_dof"],
    }
    row["best_right"] = best is not None and _is_right(name, best.law)
    row["right"] = _is_right(name, found.verdict.law)
    row["pysindy"], row["pysindy_right"] = _by_pysindy(name, found)
    return row


def _is_right(name: str, law: Law | None) -> bool:
    return law is not None and is_right(name, law.family, law.constants)


def is_right(name: str, family_name: str, constants: Mapping[str, Any]) -> bool:
    """Whether a formula has the right variables, and the right exponent of a power."""
    if name not in LAWS:
        return False
    truth, family = LAWS[name], family_name.split("*")
    if sorted(each[-1] for each in family) != sorted(truth.variables):
        return False
    if truth.power is None:
        return True
    if family[0] == "linear_q":
        return abs(truth.power - 1.0) <= EXPONENT
    if not family[0].startswith("power"):
        return False
    power = constants.get("n", constants.get("p"))
    return abs(float(power) - truth.power) <= EXPONENT


def _by_pysindy(name: str, found: Diagnosis) -> tuple[str | None, bool | None]:
    """What sparse regression makes of the missing acceleration of object 1."""
    try:
        from pysindy.optimizers import STLSQ  # pyright: ignore[reportMissingImports]
    except ImportError:
        return None, None
    if found.missing is None or name not in LAWS:
        return None, None
    acceleration, missing = found.missing.acceleration_m_s2[0], found.missing
    inside = np.isfinite(acceleration)
    if inside.sum() < 10:
        return None, None
    t, q, v = missing.time_s[inside], missing.path_m[0, inside], missing.speed_m_s[0, inside]
    powers = (0.5, 1.0, 1.5, 2.0, 3.0)
    terms = {("1", 0.0): np.ones_like(t)}
    for key, values in (("t", t), ("v", np.abs(v))):
        terms |= {(key, p): values**p for p in powers}
    terms |= {("q", p): q**p for p in (1.0, 2.0, 3.0)}
    columns = np.stack(list(terms.values()), axis=1)
    scale = np.linalg.norm(columns, axis=0)
    best = STLSQ(threshold=0.1 * float(np.linalg.norm(acceleration[inside])), alpha=1e-3)
    best.fit(columns / scale, acceleration[inside][:, None])
    chosen = [key for key, c in zip(terms, best.coef_[0], strict=True) if c and key[0] != "1"]
    text = " + ".join(f"{variable}^{power:g}" for variable, power in chosen) or "nothing"
    truth = LAWS[name]
    variables = "".join(sorted({variable for variable, _ in chosen}))
    is_right = variables == truth.variables
    if truth.power is not None:
        is_right = is_right and all(abs(p - truth.power) <= EXPONENT for _, p in chosen)
    return text, is_right


def _show(row: dict[str, Any]) -> None:
    said = f"{row['status']} {'right' if row['right'] else ''}"
    print(
        f"{row['case']:<28} chi2 {row['chi2_before']:.1f} -> {row['chi2_after']:.2f}  {said:<14} "
        f"{row['formulas'][:1]} pysindy: {row['pysindy']}  cpu {row['cpu_s']:.0f} s",
        flush=True,
    )


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--clips", type=command.whole_number(1), default=1, help="of each law")
    parser.add_argument("--seed", type=command.whole_number(0), default=0, help="of the first")
    parser.add_argument("--only", nargs="+", help="laws, library effects, none")
    parser.add_argument("--candidates", nargs="+", help="of the library (default: all)")

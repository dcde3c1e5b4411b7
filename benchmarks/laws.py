"""Are laws found that nobody wrote down before?

    python -m benchmarks laws --out DIR

Tracks with one of 24 hidden laws (`exotic_effects.py`), with an effect of the library, and with
nothing, go through the diagnosis, one clip or several. Right: the verdict is a law with the right
variables, and an exponent within 0.25 where the truth is a power. With `--candidates a,b` only
these of the library (and the forms) stand against the laws, which takes less time. What is finished
stays in DIR/results.jsonl.
"""

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import tables
from benchmarks.exotic_effects import LAWS
from benchmarks.hidden_cases import ANGLES_DEG, TRACK
from benchmarks.journal import Journal
from galileo_jax.api.simulate import simulate
from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.diagnosis.diagnose import diagnose
from galileo_jax.diagnosis.diagnosis import Law
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.measurement.measure import measure
from galileo_jax.model.effects.forms import FORMS
from galileo_jax.model.effects.registry import effect_names, make_effects
from galileo_jax.runtime.precision import in_float64

LIBRARY = ("air_drag", "constant_force", "friction_patch", "viscous_drag")
NO_LAW = "none"
NOISE_M = 0.3 / 900.0
EXPONENT = 0.25


@in_float64
def main(
    *,
    out: Path,
    clips: int = 1,
    seed: int = 0,
    only: tuple[str, ...] = (*LAWS, *LIBRARY, NO_LAW),
    candidates: str = "",
) -> dict[str, Any]:
    out.mkdir(parents=True, exist_ok=True)
    journal = Journal(out / "results.jsonl")
    tables.row("case", ("chi2", "after", "cpu s", "says"))
    library = [
        each for each in effect_names() if not each.startswith(("exotic_", "hidden_", "law_"))
    ]
    chosen = candidates.split(",") if candidates else library
    rows = []
    for own, name in enumerate(only, seed):
        case = f"{name}_{clips}_{own}"

        def diagnosed(name: str = name, own: int = own, case: str = case) -> dict[str, Any]:
            return _diagnosed(name, _clips(out / f"{case}.csv", name, own, clips), chosen)

        rows.append(row := journal.row(case, diagnosed))
        says = f" {row['status']} {'right ' * row['right']}{row['formulas'][:1]}"
        tables.row(case, (row["chi2_before"], row["chi2_after"], row["cpu_s"], says))
    hidden = [row for row in rows if row["name"] in LAWS]
    others = [row for row in rows if row["name"] not in LAWS]
    seen = [row for row in hidden if row["chi2_before"] > 1.5]
    laws = [row for row in hidden if row["status"] == "law"]
    figures = {
        "num": len(hidden),
        "seen": len(seen),
        "right": tables.mean(row["right"] for row in seen),
        "wrong_claims": tables.mean(row["status"] == "law" and not row["right"] for row in hidden),
        "named_wrongly": tables.mean(row["status"] == "named" for row in seen),
        "best_formula_right": tables.mean(row["best_right"] for row in seen if row["formulas"]),
        "law_where_none": tables.mean(row["status"] == "law" for row in others),
        "num_others": len(others),
        "cpu_s": float(np.median([row["cpu_s"] for row in rows])),
    }
    tables.summary(figures)
    after = [row["chi2_after"] for row in laws if row["right"]]
    return figures | {"clips": clips, "seed": seed, "candidates": chosen, "chi2_after": after}


def _clips(path: Path, name: str, seed: int, count: int) -> list[Clip]:
    """Simulated clips in which that is hidden."""
    effect = f"hidden_{name}" if name in LAWS else name
    made = simulate(
        path,
        effects={} if name == NO_LAW else {effect: {}},
        strength=None if name == NO_LAW else 0.5,
        seed=seed,
        angle=ANGLES_DEG[seed % 3],
        track_noise=NOISE_M,
        fps=30.0,
        **TRACK,
        series=count if count > 1 else None,
    )
    return [load_clip(one.with_suffix(".yaml")) for one in made.clips]


def _diagnosed(name: str, clips: Sequence[Clip], chosen: Sequence[str]) -> dict[str, Any]:
    """What a diagnosis says, which knows these effects of the library, and whether it is right."""

    def problem_with(names: Sequence[str]) -> JointProblem:
        seen = [measure(clip).observation for clip in clips]
        return make_joint_problem(clips, seen, "auto", (*make_effects(names), *FORMS))

    trials = problem_with(chosen)
    if absent := trials.without_place():
        trials = problem_with([each for each in chosen if each not in absent])
    began = time.process_time()
    found = diagnose(trials, seed=0)
    laws = [c for c in found.candidates if c.law is not None]
    return {
        "name": name,
        "cpu_s": time.process_time() - began,
        "status": found.verdict.status,
        "effects": list(found.verdict.effects),
        "formulas": [c.law.text for c in laws if c.law is not None],
        "chi2_before": found.rounds[0].comparison.error["chi2_per_dof"],
        "chi2_after": found.rounds[-1].comparison.error["chi2_per_dof"],
        "best_right": bool(laws) and _is_right(name, laws[0].law),
        "right": _is_right(name, found.verdict.law),
    }


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

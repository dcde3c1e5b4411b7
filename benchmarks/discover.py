"""Does `discover` find what a lab hides, an effect or a law, and how often is it wrong?

    python -m benchmarks discover --out DIR --budget 16 --first 100 --seeds 1
    python -m benchmarks discover --out DIR --effects hidden_heating,hidden_gust

Each effect (and none) is hidden `--seeds` times in new objects; a lab can vary height and angle.
`hidden_NAME` is a law of `exotic_effects.py`, right as in `laws`. `--noise speed`: a velocity is
known to 7.5 % of the range of the speed (as in NewtonBench); `--noise px`: 0.3 px at 900 px/m.
What is finished stays in DIR. Seeds below 100 were looked at during development.
"""

import itertools
import time
from pathlib import Path
from typing import Any

import galileo_jax as gx
from benchmarks import hidden_cases, labs, tables
from benchmarks.journal import Journal


def main(
    *,
    out: Path,
    effects: str = "",
    noise: labs.Noise = "px",
    budget: int = 16,
    seeds: int = 1,
    first: int = 100,
) -> dict[str, Any]:
    hidden = effects.split(",") if effects else [labs.NONE, *hidden_cases.ramp_effects()]
    journal = Journal(out / "results.jsonl")
    shown = ("verdict", "experiments", "is_right", "is_wrong", "cpu_s")
    tables.row("lab", shown)
    rows = []
    for seed, effect in itertools.product(range(first, first + seeds), hidden):
        lab = labs.SimulatedLab(out / f"{effect}_{noise}_{seed}", effect, seed, noise)
        rows.append(journal.row(lab.folder.name, lambda lab=lab: _discovered(lab, budget)))
        tables.row(f"{effect} {seed}", [rows[-1][key] for key in shown])
    count = len(rows)
    right, wrong = (sum(row[key] for row in rows) for key in ("is_right", "is_wrong"))
    tables.row(f"all {count}", ("", "", f"{right}/{count}", f"{wrong}/{count}", ""))
    return {"noise": noise, "budget": budget, "right": right, "wrong": wrong, "labs": rows}


def _discovered(lab: labs.SimulatedLab, budget: int) -> dict[str, Any]:
    """What `discover` says of a lab, and whether that is right."""
    lab.folder.mkdir(parents=True, exist_ok=True)
    began = time.process_time()
    found = gx.discover(lab, budget=budget, out=lab.folder / "run", seed=lab.seed)
    says = "+".join(found.effects) or str(found.status)
    is_settled = found.status in ("named", "none", "law")
    law = found.document["rounds"][-1]["law"] if found.status == "law" else None
    is_right = is_settled and (says == lab.effect if law is None else lab.is_right(law))
    return {
        "verdict": says if found.status != "ambiguous" else "ambiguous",
        "law": None if law is None else law["text"],
        "experiments": len(found.experiments),
        "is_right": is_right,
        "is_wrong": is_settled and not is_right,
        "cpu_s": round(time.process_time() - began),
    }

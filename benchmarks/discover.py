"""Right and confidently wrong of `discover`, over labs that hide an effect, or a law.

    python -m benchmarks discover --out DIR --budget 16 --first 100 --seeds 1
    python -m benchmarks discover --out DIR --effects hidden_heating,hidden_gust

Each effect (and none) is hidden `--seeds` times in new objects; a lab can vary height and angle.
`hidden_NAME` is a law of `hidden_laws.py`, right as in `laws.py`. What is interrupted goes on.
`--noise speed`: a velocity is known to 7.5 % of the range of the speed (as in NewtonBench);
`--noise px`: 0.3 px at 900 px/m. What is finished stays in DIR and is not done again. Seeds below
100 were looked at during development.
"""

import argparse
import json
import time
from pathlib import Path
from typing import Any

import galileo_jax as gx
from benchmarks import hidden_cases, labs, tables
from galileo_jax.commands import command
from galileo_jax.runtime.atomic_write import write_json


def main(call: argparse.Namespace) -> dict[str, Any]:
    effects = call.effects.split(",") if call.effects else [labs.NONE, *hidden_cases.ramp_effects()]
    tables.row("lab", ("verdict", "experiments", "right", "wrong", "CPU s"))
    rows = []
    for seed in range(call.first, call.first + call.seeds):
        for effect in effects:
            rows.append(_lab(call, effect, seed))
            shown = ("verdict", "experiments", "is_right", "is_wrong", "cpu_s")
            tables.row(f"{effect} {seed}", [rows[-1][key] for key in shown])
    count = len(rows)
    right, wrong = (sum(row[key] for row in rows) for key in ("is_right", "is_wrong"))
    tables.row(f"all {count}", ("", "", f"{right}/{count}", f"{wrong}/{count}", ""))
    return {"noise": call.noise, "budget": call.budget, "labs": rows}


def _lab(call: argparse.Namespace, effect: str, seed: int) -> dict[str, Any]:
    folder: Path = call.out / f"{effect}_{call.noise}_{seed}"
    done = folder / "row.json"
    if done.is_file():
        return json.loads(done.read_text())
    folder.mkdir(parents=True, exist_ok=True)
    lab = labs.SimulatedLab(folder, effect, seed, call.noise)
    began = time.process_time()
    found = gx.discover(lab, budget=call.budget, out=folder / "run", seed=seed)
    says = "+".join(found.effects) or str(found.status)
    is_settled = found.status in ("named", "none", "law")
    law = found.document["rounds"][-1]["law"] if found.status == "law" else None
    is_right = is_settled and (says == effect if law is None else lab.is_right(law))
    row = {
        "lab": f"{effect} {seed}",
        "verdict": says if found.status != "ambiguous" else "ambiguous",
        "law": None if law is None else law["text"],
        "experiments": len(found.experiments),
        "is_right": is_right,
        "is_wrong": is_settled and not is_right,
        "cpu_s": round(time.process_time() - began),
    }
    write_json(done, row)
    return row


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--out", type=Path, required=True, metavar="DIR")
    parser.add_argument("--effects", default="", help="names (default: none and all)")
    parser.add_argument("--noise", choices=labs.NOISES, default="px")
    parser.add_argument("--budget", type=command.whole_number(1), default=16)
    parser.add_argument("--seeds", type=command.whole_number(1), default=1)
    parser.add_argument("--first", type=command.whole_number(0), default=100, help="seed")

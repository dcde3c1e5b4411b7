"""How often does a diagnosis find something where nothing is hidden?

    python -m benchmarks false_alarms --sort bullet --num 40 --seed 90000

The tracks are those of `calibration`: four engines move the same kind of ramp experiment, or
videos of it are rendered and tracked. An alarm is any verdict but `none`. Bars: at most 2 % where
the truth is the rigid engine's (`exact`, `rendered`) or another solver's with the faults of real
clips (`fine`, `rendered-faults`), 5 % where it is MuJoCo's or Bullet's.
"""

import argparse
import time
from collections import Counter
from typing import Any

from benchmarks import calibration, tables
from galileo_jax.api.diagnose import diagnose
from galileo_jax.commands import command

BARS = dict.fromkeys(calibration.SORTS, 0.02) | {"mujoco": 0.05, "bullet": 0.05}


def main(call: argparse.Namespace) -> dict[str, Any]:
    statuses, alarms = Counter[str](), []
    tables.row("track", ("chi2/dof", "p", "CPU s", "says"))
    for seed in range(call.seed, call.seed + call.num):
        began = time.process_time()
        _, track = calibration.make_track(call.sort, seed)
        found = diagnose(track, seed=seed)
        statuses[found.verdict.status] += 1
        says = " ".join([found.verdict.status, " | ".join(found.verdict.effects)])
        if found.verdict.status != "none":
            alarms.append(f"{seed}: {says}")
        first = found.document["history"][0]
        cost = time.process_time() - began
        tables.row(str(seed), [first["chi2_per_dof"], found.document["p_value"], cost, says])
    print(f"{call.sort}: {len(alarms)} alarms of {call.num}, at most {BARS[call.sort]:.0%} wanted")
    figures = {"sort": call.sort, "num": call.num, "seed": call.seed, "alarms": alarms}
    return figures | {"share": len(alarms) / call.num, "statuses": dict(statuses)}


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--sort", choices=tuple(BARS), required=True, help="what moves the objects")
    parser.add_argument("--num", type=command.whole_number(1), default=40, help="tracks")
    parser.add_argument("--seed", type=command.whole_number(0), default=0, help="of the first")

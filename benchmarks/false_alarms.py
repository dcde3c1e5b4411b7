"""How often does a diagnosis find something where nothing is hidden?

    python -m benchmarks false_alarms --sort bullet --num 40 --seed 90000

The tracks are those of `calibration`: four engines move the same kind of ramp experiment, or
videos of it are rendered and tracked. An alarm is any verdict but `none`. Bars: at most 2 % where
the truth is the rigid engine's (`exact`, `rendered`) or another solver's with the faults of real
clips (`fine`, `rendered-faults`), 5 % where it is MuJoCo's or Bullet's.
"""

import time
from collections import Counter
from typing import Any, get_args

from benchmarks import calibration, tables
from benchmarks.calibration import Sort
from galileo_jax.api.diagnose import diagnose

BARS = dict.fromkeys(get_args(Sort), 0.02) | {"mujoco": 0.05, "bullet": 0.05}


def main(*, sort: Sort, num: int = 40, seed: int = 0) -> dict[str, Any]:
    statuses, alarms = Counter[str](), []
    tables.row("track", ("chi2/dof", "p", "CPU s", "says"))
    for each in range(seed, seed + num):
        began = time.process_time()
        _, track = calibration.make_track(sort, each)
        found = diagnose(track, seed=each)
        statuses[found.verdict.status] += 1
        says = " ".join([found.verdict.status, " | ".join(found.verdict.effects)])
        if found.verdict.status != "none":
            alarms.append(f"{each}: {says}")
        first = found.document["history"][0]
        cost = time.process_time() - began
        tables.row(str(each), [first["chi2_per_dof"], found.document["p_value"], cost, says])
    print(f"{sort}: {len(alarms)} alarms of {num}, at most {BARS[sort]:.0%} wanted")
    figures = {"sort": sort, "num": num, "seed": seed, "alarms": alarms}
    return figures | {"share": len(alarms) / num, "statuses": dict(statuses)}

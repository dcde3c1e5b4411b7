"""How often does a diagnosis find something where nothing is hidden?

    python benchmarks/false_alarms.py --sort bullet --num 40 --seed 90000

The tracks are those of `calibration.py`: four engines move the same kind of ramp experiment, or
videos of it are rendered and tracked. An alarm is any verdict but `none`. Bars: at most 2 % where
the truth is the rigid engine's (`exact`, `rendered`) or another solver's with the faults of real
clips (`fine`, `rendered-faults`), 5 % where it is MuJoCo's or Bullet's. The last line is JSON.
"""

import argparse
import time
from collections import Counter
from collections.abc import Sequence

import calibration
import tables

from galileo_jax.api.diagnose import diagnose
from galileo_jax.commands import command

BARS = {"exact": 0.02, "fine": 0.02, "mujoco": 0.05, "bullet": 0.05} | dict.fromkeys(
    calibration.RENDERED, 0.02
)


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
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
    share = len(alarms) / call.num
    print(f"{call.sort}: {len(alarms)} alarms of {call.num}, at most {BARS[call.sort]:.0%} wanted")
    figures = {"sort": call.sort, "num": call.num, "seed": call.seed, "alarms": alarms}
    tables.finish("false_alarms", figures | {"share": share, "statuses": dict(statuses)})
    return None


def _parser() -> command.Parser:
    parser = command.Parser(prog="false_alarms.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--sort", choices=tuple(BARS), required=True, help="what moves the objects")
    parser.add_argument("--num", type=command.whole_number(1), default=40, help="tracks")
    parser.add_argument("--seed", type=command.whole_number(0), default=0, help="of the first")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

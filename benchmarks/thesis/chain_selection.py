"""Which of 16 chains is believed, and which proposals are taken.

    best            the sample of highest similarity in all chains (the thesis)
    least variance  the mean of the chain that varies least
    all chains      the mean of everything

each with the thesis's coin and with a true Metropolis-Hastings acceptance. Mean absolute errors
over --num truths. `python benchmarks/thesis/chain_selection.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.thesis.sampler import Acceptance, Selection, select


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    cases = setting.experiments(call.seed, call.num, call.frames)
    truths = np.array([case.theta for case in cases])
    setting.row("acceptance, selection", (*setting.QUANTITIES, "L1", "L2"))
    found, bars = {}, {}
    for acceptance in Acceptance:
        answers = [
            setting.chains(case, number, acceptance=acceptance) for number, case in enumerate(cases)
        ]
        rules = {
            "best": [select(answer, Selection.BEST) for answer in answers],
            "least variance": [select(answer, Selection.LEAST_VARIANCE) for answer in answers],
            "all chains": [answer.flat().mean(0) for answer in answers],
        }
        for rule, chosen in rules.items():
            error = setting.errors(np.array(chosen), truths).mean(0)
            pairs = zip(chosen, cases, strict=True)
            distance = np.mean([setting.distances(theta, case) for theta, case in pairs], axis=0)
            setting.row(f"{acceptance}, {rule}", [*error, *distance])
            found[f"{acceptance}, {rule}"] = {"error": error, "distance": distance}
            bars[f"{acceptance}\n{rule}"] = distance[0]
    with setting.figure(call, "chain_selection", columns=2) as axes:
        axes[0, 0].barh(list(bars), list(bars.values()))
        axes[0, 0].set(title="L1 distance, m/frame")
        axes[0, 0].invert_yaxis()
        for name, entry in found.items():
            axes[0, 1].plot(setting.QUANTITIES, entry["error"], "o", label=name)
        axes[0, 1].set(title="mean absolute error", yscale="log")
        axes[0, 1].legend(fontsize=6)
    setting.finish(call, "chain_selection", found)
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))

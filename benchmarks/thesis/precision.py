"""Precision: the same observation inferred 30 times with other random numbers.

`python benchmarks/thesis/precision.py`
"""

from collections.abc import Sequence

import numpy as np
import setting

from galileo_jax.commands import command


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=30)
    (case,) = setting.experiments(call.seed, 1, call.frames)
    runs = np.array([setting.infer(case, number) for number in range(call.num)])
    values, truth = setting.quantities(runs), setting.quantities(case.theta)
    setting.row(f"{call.num} runs", setting.QUANTITIES)
    rows = {
        "truth": truth,
        "mean": values.mean(0),
        "sd over runs": values.std(0, ddof=1),
        "rms error": np.sqrt(np.mean((values - truth) ** 2, axis=0)),
    }
    for name, entries in rows.items():
        setting.row(name, list(entries))
    with setting.figure(call, "precision", columns=len(truth)) as axes:
        for i, name in enumerate(setting.QUANTITIES):
            axes[0, i].hist(values[:, i], bins=12)
            axes[0, i].axvline(truth[i], color="black", linewidth=0.8)
            axes[0, i].set(title=name)
    setting.finish(call, "precision", rows)
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))

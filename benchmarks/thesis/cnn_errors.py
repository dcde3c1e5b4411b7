"""The thesis's network on 1,000 new noise-free samples: mean absolute errors beside its table.

The networks beside this script are `galileo train --preset thesis [--frames 110]`; --frames says
which. Beside them: guessing the middle of every range, and what a perfect network is left with
where only the ratio of the masses shows. `python benchmarks/thesis/cnn_errors.py`
"""

import time
from collections.abc import Sequence

import jax
import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.neural.checkpoint import load_network
from galileo_jax.neural.dataset import make_samples
from galileo_jax.neural.evaluation import TEST_SHARD
from galileo_jax.thesis.network import RANGES
from galileo_jax.thesis.task import NAMES, THESIS_MAE


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=1000)
    network, config = load_network(setting.NETWORKS / f"thesis_{call.frames}.npz")
    data = make_samples(setting.task(call.frames), call.seed, TEST_SHARD, call.num)
    read = jax.jit(lambda profile: network(profile))
    read(data["profile"])
    began = time.perf_counter()
    found = np.asarray(read(data["profile"]))
    seconds = time.perf_counter() - began
    truth = data["target"]
    rows = {
        "network": np.abs(found - truth).mean(0),
        "the thesis's": np.array(list(THESIS_MAE.values())),
        "the middle": np.abs(np.array(RANGES) / 2 - truth).mean(0),
        "only the ratio": [least_error(truth[:, 0], truth[:, 2]), None] * 2,
    }
    setting.row("mean absolute error", NAMES)
    for name, errors in rows.items():
        setting.row(name, list(errors))
    print(f"{1e3 * seconds / call.num:.3f} ms a profile; trained with seed {config.seed}")
    with setting.figure(call, f"cnn_errors_{call.frames}", columns=4) as axes:
        for i, name in enumerate(NAMES):
            axes[0, i].plot(truth[:, i], found[:, i], ".", markersize=2)
            axes[0, i].axline((0, 0), slope=1, color="black", linewidth=0.6)
            axes[0, i].set(title=name, xlabel="truth", ylabel="network")
    setting.finish(call, f"cnn_errors_{call.frames}", {"mae": rows, "seconds": seconds})
    return None


def least_error(m1: np.ndarray, m2: np.ndarray) -> float:
    """Mean error of a mass of one who knows m1 / m2 exactly and nothing else.

    Along a ratio both masses are uniform up to where the larger one reaches 1; density grows
    with their size, so that the median lies at 1 / sqrt(2) of it.
    """
    ratio = m1 / m2
    largest = np.minimum(1.0, ratio)
    return float(np.mean(np.abs(m1 - largest / np.sqrt(2))))


if __name__ == "__main__":
    raise SystemExit(command.run(main))

"""phi = (m1 - m2) / (m1 + m2) learned, in place of two masses that cannot be told singly.

The thesis's network is trained anew on (phi, k1, phi, k2), briefly: --num epochs, with a cosine
schedule. Beside it: phi made of the masses that the thesis's network, trained for long, reads off.
`python benchmarks/thesis/phi_learned.py`
"""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import setting

from galileo_jax.commands import command
from galileo_jax.commands.progress_display import progress_display
from galileo_jax.neural.checkpoint import NETWORK, load_network
from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.dataset import make_samples
from galileo_jax.neural.evaluation import TEST_SHARD
from galileo_jax.neural.task import Arrays
from galileo_jax.neural.training import train
from galileo_jax.runtime.progress import scope
from galileo_jax.thesis.network import RANGES, ThesisNetwork
from galileo_jax.thesis.task import ThesisTask

EPOCHS = 80
SCALES = (2.0, RANGES[1], 2.0, RANGES[3])


class PhiTask(ThesisTask):
    """The thesis's network and data; the masses' two places hold phi."""

    def make(self, key: jax.Array, count: int) -> Arrays:
        """As the thesis's samples, with other targets."""
        made = super().make(key, count)
        theta = made["target"]
        phi = setting.quantities(theta)[:, -1]
        target = np.stack([phi, theta[:, 1], phi, theta[:, 3]], axis=1)
        return {"profile": made["profile"], "target": target.astype(np.float32)}

    @staticmethod
    def loss(network: ThesisNetwork, batch: dict[str, jax.Array]) -> jax.Array:
        """Mean absolute error, each number in units of its range."""
        error = jnp.abs(network(batch["profile"]) - batch["target"])
        return jnp.mean(error / jnp.asarray(SCALES))


def main(argv: Sequence[str]) -> int | None:
    call = setting.start(argv, __doc__, num=EPOCHS)
    config = TrainConfig(
        preset="thesis", seed=call.seed, samples=10000, batch=64, learning_rate=1e-3,
        schedule="cosine", max_epochs=call.num, frames=call.frames,
    )  # fmt: skip
    task = PhiTask(config)
    with tempfile.TemporaryDirectory() as folder, progress_display() as on_progress:
        data = make_samples(task, config.seed, 0, config.samples)
        with scope(on_progress):
            train(task, config, data, Path(folder))
        learned, _ = load_network(Path(folder) / NETWORK)
    of_masses, _ = load_network(setting.NETWORKS / f"thesis_{call.frames}.npz")
    test = make_samples(task, config.seed, TEST_SHARD, 1000)
    profile, truth = test["profile"], test["target"]
    read = np.asarray(learned(profile))
    masses = np.asarray(of_masses(profile))
    made = setting.quantities(np.clip(masses, 1e-3, None))[:, -1]
    phi = truth[:, 0]
    errors = {
        "learned": np.abs(read[:, [0, 1, 3]] - truth[:, [0, 1, 3]]).mean(0),
        "of learned masses": np.abs(
            np.stack([made, *masses.T[[1, 3]]]).T - truth[:, [0, 1, 3]]
        ).mean(0),
        "guess 0 / the middle": np.abs(np.array([0, 0.15, 0.15]) - truth[:, [0, 1, 3]]).mean(0),
    }
    setting.row("mean absolute error", ("phi", "k1", "k2"))
    for name, entries in errors.items():
        setting.row(name, list(entries))
    with setting.figure(call, "phi_learned", columns=2) as axes:
        for i, (name, values) in enumerate((("learned", read[:, 0]), ("of masses", made))):
            axes[0, i].plot(phi, values, ".", markersize=2)
            axes[0, i].axline((0, 0), slope=1, color="black", linewidth=0.6)
            axes[0, i].set(title=f"phi, {name}", xlabel="truth", ylabel="network", ylim=(-1.1, 1.1))
    setting.finish(call, "phi_learned", {"mae": errors})
    return None


if __name__ == "__main__":
    raise SystemExit(command.run(main))

"""How good is the network on simulated samples?

    python -m benchmarks neural [--network FILE]

Two tables for the network that ships with the package (or FILE): 1,000 new samples of the thesis's
setting, at several noise levels; 2,000 new samples of all scenes. Mean absolute errors, coverage of
90 % intervals, and KS p-values of the truths' ranks. On clips: `accuracy FOLDER --method cnn`.
"""

from pathlib import Path
from typing import Any

import jax
import numpy as np
from scipy import stats

from benchmarks import tables
from galileo_jax.neural.config import load_config
from galileo_jax.neural.dataset import make_samples
from galileo_jax.neural.estimate import TRAINED, trained_network
from galileo_jax.neural.galileo_task import GalileoTask, estimate
from galileo_jax.neural.posterior_network import PosteriorNetwork
from galileo_jax.neural.task import Arrays
from galileo_jax.runtime.precision import in_float64
from galileo_jax.thesis.clips import thesis_clips

NUM_THESIS, NUM_CLIPS, NUM_DRAWS = 1000, 2000, 1000
NOISES_M = (0.0, 2.2e-5, 2e-4, 1e-3)
LEAST_NOISE_M = 1e-5  # what the network is told where there is none
SHARD = 2**30 + 1


@in_float64
def main(*, network: Path = TRAINED, seed: int = 0) -> dict[str, Any]:
    trained = trained_network(network)
    tables.row("setting", ("quantity", "count", "MAE", "median", "in 90%", "KS p"))
    settings = {
        f"thesis {noise:g} m": thesis_clips(
            jax.random.key(seed), NUM_THESIS, noise, stated_noise_m=max(noise, LEAST_NOISE_M)
        )
        for noise in NOISES_M
    }
    task = GalileoTask(load_config(Path("configs/train_galileo.yaml")))
    clips = make_samples(task, seed, SHARD, NUM_CLIPS)
    for label, ideal in (("clips", 0), ("ideal", 1)):
        settings[label] = {key: each[clips["is_ideal"] == ideal] for key, each in clips.items()}
    return {label: _score(label, trained, some) for label, some in settings.items()}


def _score(label: str, network: PosteriorNetwork, clips: Arrays) -> dict[str, Any]:
    draws = estimate(network, clips, 0, NUM_DRAWS)
    k1, k2, ratio = clips["truth"].T
    moves = clips["moves"]
    told = clips.get("collides", clips["is_hit"]) & moves
    table = {}
    for name, drawn, true, where in (
        ("k1", draws.k1, k1, moves),
        ("phi", _phi(draws.mass_ratio), _phi(ratio), told),
        ("k2", draws.k2, k2, told),
    ):
        error = np.abs(drawn.mean(1) - true)[where]
        low, high = np.quantile(drawn, (0.05, 0.95), axis=1)
        rank = np.mean(drawn < true[:, None], axis=1)[where]
        table[name] = {
            "count": int(where.sum()),
            "mae": float(error.mean()),
            "median": float(np.median(error)),
            "in_90": float(np.mean(((low <= true) & (true <= high))[where])),
            "ks_p": float(stats.kstest(rank, "uniform").pvalue),
        }
        tables.row(label, [name, *table[name].values()])
    return table


def _phi(ratio: np.ndarray) -> np.ndarray:
    return (ratio - 1) / (ratio + 1)

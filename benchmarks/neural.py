"""The neural estimators: `python benchmarks/neural.py [FOLDER --tracks DIR] [--network FILE]`.

Three tables for the network that ships with the package (or FILE):

    thesis   1,000 new samples of the thesis's setting, at several noise levels: mean absolute
             errors, coverage of 90 % intervals, and KS p-values of the truths' ranks
    clips    the same on 2,000 new samples of all scenes
    FOLDER   clips with a truth and no hidden effect, through `fit --method cnn` after tracking

The last line is JSON.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
import scoring
import tables
from scipy import stats

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import read_observation_csv, write_observation_csv
from galileo_jax.commands import command
from galileo_jax.inference.build_problem import make_joint_problem
from galileo_jax.inference.result import make_result
from galileo_jax.measurement.measure import measure
from galileo_jax.neural.config import load_config
from galileo_jax.neural.dataset import make_samples
from galileo_jax.neural.estimate import TRAINED, cnn_posterior, trained_network
from galileo_jax.neural.galileo_task import GalileoTask, estimate
from galileo_jax.neural.posterior_network import PosteriorNetwork
from galileo_jax.neural.task import Arrays
from galileo_jax.runtime import compilation_cache
from galileo_jax.thesis.clips import thesis_clips

NUM_THESIS, NUM_CLIPS, NUM_DRAWS = 1000, 2000, 1000
NOISES_M = (0.0, 2.2e-5, 2e-4, 1e-3)
LEAST_NOISE_M = 1e-5  # what the network is told where there is none
SHARD = 2**30 + 1


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    network = trained_network(call.network)
    columns = ("quantity", "count", "MAE", "median", "closed form", "in 90%", "KS p")
    tables.row("setting", columns)
    found: dict[str, Any] = {}
    for noise in NOISES_M:
        key = jax.random.key(call.seed)
        clips = thesis_clips(key, NUM_THESIS, noise, stated_noise_m=max(noise, LEAST_NOISE_M))
        found[f"thesis {noise:g} m"] = _score(f"thesis {noise:g} m", network, clips)
    task = GalileoTask(load_config(Path("configs/train_galileo.yaml")))
    clips = make_samples(task, call.seed, SHARD, NUM_CLIPS)
    for label, ideal in (("clips", 0), ("ideal", 1)):
        some = {name: values[clips["is_ideal"] == ideal] for name, values in clips.items()}
        found[label] = _score(label, network, some)
    if call.folder:
        print()
        found["real"] = _real(call, network)
    tables.finish("neural", found)
    return None


def _score(label: str, network: PosteriorNetwork, clips: Arrays) -> dict[str, Any]:
    draws = estimate(network, clips, 0, NUM_DRAWS)
    k1, k2, ratio = clips["truth"].T
    rough = estimate_of_closed_form(clips)
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
            "closed_form_mae": float(np.abs(rough[name] - true)[where].mean()),
            "in_90": float(np.mean(((low <= true) & (true <= high))[where])),
            "ks_p": float(stats.kstest(rank, "uniform").pvalue),
        }
        tables.row(label, [name, *table[name].values()])
    return table


def estimate_of_closed_form(clips: Arrays) -> dict[str, np.ndarray]:
    """What summary.py alone says."""
    k1, log_ratio, k2 = clips["centre"].T
    ratio = np.exp(np.sqrt(2) * 0.7 * log_ratio)
    return {"k1": stats.norm.cdf(k1), "phi": _phi(ratio), "k2": stats.norm.cdf(k2)}


def _phi(ratio: np.ndarray) -> np.ndarray:
    return (ratio - 1) / (ratio + 1)


def _real(call: argparse.Namespace, network: PosteriorNetwork) -> dict[str, Any]:
    columns = ("k1 err", "in 95%", "k2 err", "in 95%", "ratio err", "in 95%", "usual", "seconds")
    tables.row("clip", columns)
    scores, seconds = [], []
    for path in sorted(call.folder.glob("*.truth.json")):
        truth = json.loads(path.read_text())
        if truth["effect"] != call.set and call.set != "all":
            continue
        name = path.name.removesuffix(".truth.json")
        clip = load_clip(path.with_name(f"{name}.yaml"))
        kept = call.tracks / f"{name}.csv" if call.tracks else None
        if kept and kept.is_file():
            observation = read_observation_csv(kept)
        else:
            observation = measure(clip).observation
            if kept:
                write_observation_csv(kept, observation)
        trials = make_joint_problem([clip], [observation])
        cnn_posterior(trials, call.seed, network)
        began = time.perf_counter()
        posterior, z, notes = cnn_posterior(trials, call.seed, network)
        seconds.append(time.perf_counter() - began)
        result = make_result(
            trials, posterior, z, clips=[name], method="cnn", seed=0, timings_s={}, notes=notes
        )
        moves = truth["events_s"]["foot"] is not None
        entry = scoring.score(
            scoring.of_result(result), truth, truth["events_s"]["hit"] is not None, moves
        )
        scores.append(entry)
        cells: list[Any] = []
        for one in entry.values():
            if one.is_scored:
                cells += [one.error, one.is_covered]
            else:
                said = "MISSED" if one.is_expected else "not told"
                cells += ["CLAIMED" if one.is_identified and not one.is_expected else said, None]
        tables.row(name, [*cells, posterior.is_converged, seconds[-1]])
    table: dict[str, Any] = scoring.summary(scores)
    for name, entry in table.items():
        tables.row(name, [f"{key} {value:.4g}" for key, value in entry.items()])
    return table | {"seconds_median": float(np.median(seconds)), "seconds_worst": max(seconds)}


def _parser() -> command.Parser:
    parser = command.Parser(prog="neural.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--network", type=Path, default=TRAINED)
    parser.add_argument("--set", default="none", help="an effect in the truth, or all")
    parser.add_argument("--tracks", type=Path, help="keep tracks there; reuse what is there")
    parser.add_argument("--seed", type=int, default=0)
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

"""What does a sweep cost?

    python -m benchmarks scaling [--only clips workers] [--clips 64]

    clips     seconds per clip of `grad` against the number of clips, in one process, and what the
              same clips cost once more, when their programs are compiled (the marginal cost, bar
              3 s)
    workers   seconds per clip of a sweep against its workers

Clips are csv tracks by `galileo simulate`. Seconds are wall clock: run it on a quiet machine.
Rollouts per second are in `accelerator`.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import tables
from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import measure

CLIPS = (1, 2, 4, 8, 16, 32, 64)


def main(*, only: tuple[str, ...] = ("clips", "workers"), clips: int = CLIPS[-1]) -> dict[str, Any]:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the sweeps' processes
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        paths = make_tracks(Path(folder), clips)
        if "clips" in only:
            figures["clips"] = cost_of_clips(paths)
        if "workers" in only:
            figures["workers"] = cost_with_workers(Path(folder), paths[: clips // 2])
    return figures


def make_tracks(folder: Path, count: int) -> list[Path]:
    paths = [folder / f"track_{seed}.csv" for seed in range(count)]
    for seed, path in enumerate(paths):
        simulate(path, track_only=True, seed=seed)
    return paths


def cost_of_clips(paths: Sequence[Path]) -> dict[str, float]:
    """Seconds per clip, and of the same clips once more, when all programs are there."""
    from galileo_jax.sweeping.settings import Grad
    from galileo_jax.sweeping.work import run_cell

    tables.row("clips", ("s per clip", "once more", "longest"))
    first, again = [], []
    for count, path in enumerate(paths, 1):
        for seconds in (first, again):
            began = time.perf_counter()
            run_cell(Grad(), (measure(load_clip(path)),))
            seconds.append(time.perf_counter() - began)
        if count in CLIPS:
            tables.row(str(count), (np.mean(first), np.mean(again), max(again)))
    means = {"s_per_clip": float(np.mean(first)), "marginal_s": float(np.mean(again))}
    return means | {"longest_s": max(again)}


def cost_with_workers(folder: Path, paths: Sequence[Path]) -> dict[str, float]:
    from galileo_jax.sweeping.resources import Resources, num_workers

    tables.row("workers", ("s per clip", "speed-up"))
    found: dict[str, float] = {}
    for count in range(1, num_workers(Resources()) + 1):
        began = time.perf_counter()
        run_sweep(folder / f"workers_{count}", paths, count)
        found[str(count)] = (time.perf_counter() - began) / len(paths)
        tables.row(str(count), (found[str(count)], found["1"] / found[str(count)]))
    return found


def run_sweep(out: Path, clips: Sequence[Path], workers: int) -> None:
    out.mkdir(parents=True)
    config = out / "config.yaml"
    config.write_text(json.dumps({"clips": [str(path) for path in clips]}))  # YAML, too
    words = [str(config), "--out", str(out), "--workers", str(workers)]
    subprocess.run(
        [sys.executable, "-m", "galileo_jax", "sweep", *words],
        check=True,
        stdout=subprocess.DEVNULL,
    )

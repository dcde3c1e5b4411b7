"""What does a sweep cost?

    python -m benchmarks scaling [--only clips workers] [--clips 64]

    clips     seconds per clip of `grad` against the number of clips, in one process, and what the
              clips after the first of their shape cost (the marginal cost, bar 3 s)
    workers   seconds per clip of a sweep against its workers

Clips are csv tracks by `galileo simulate`. A shape is what programs are compiled for: numbers of
objects, frames (in steps of 64) and recorded instants (in steps of 128). Seconds are wall clock:
run it on a quiet machine. Rollouts per second are in `accelerator`.
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
from galileo_jax.measurement.measure import Measurement, measure

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
        if not path.is_file():
            simulate(path, track_only=True, seed=seed)
    return paths


def cost_of_clips(paths: Sequence[Path]) -> dict[str, Any]:
    """Seconds per clip, of all and of those whose shape another had before."""
    from galileo_jax.sweeping.settings import Grad
    from galileo_jax.sweeping.work import run_cell

    shapes = set[tuple[int, ...]]()
    seconds, later = [], []
    tables.row("clips", ("s per clip", "shapes"))
    for count, path in enumerate(paths, 1):
        began = time.perf_counter()
        measured = measure(load_clip(path))
        run_cell(Grad(), (measured,))
        seconds.append(time.perf_counter() - began)
        if (shape := shape_of(measured)) in shapes:
            later.append(seconds[-1])
        shapes.add(shape)
        if count in CLIPS:
            tables.row(str(count), (float(np.mean(seconds)), len(shapes)))
    figures = {
        "seconds_per_clip": float(np.mean(seconds)),
        "marginal_s": float(np.mean(later)),
        "marginal_largest_s": max(later),
        "shapes": len(shapes),
    }
    tables.summary(figures)
    return figures


def shape_of(measured: Measurement) -> tuple[int, ...]:
    """What programs are compiled for: objects, frames, recorded instants."""
    from galileo_jax.inference.build_problem import make_problem
    from galileo_jax.rollout.engine_jax import RECORDS
    from galileo_jax.runtime.batching import FRAMES, rounded_up

    problem = make_problem(measured.clip, measured.observation)
    count, _, frames = measured.observation.position_m.shape
    return count, rounded_up(frames, FRAMES), rounded_up(problem.model.num_records + 1, RECORDS)


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

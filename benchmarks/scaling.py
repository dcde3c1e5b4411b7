"""What does a sweep cost?

    python -m benchmarks scaling [--only clips workers memory]

    clips     seconds per clip of `grad` against the number of clips, in one process, and what the
              clips after the first of their shape cost (the marginal cost, bar 3 s)
    workers   seconds per clip of a sweep against its workers
    memory    peak memory of a sweep of 100 cells and of 1,000, of the parent and of the worker
              (bar: 1.2 times as much)

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


def main(
    *,
    only: tuple[str, ...] = ("clips", "workers", "memory"),
    clips: int = CLIPS[-1],
    method: str = "grad",
    cells: tuple[int, ...] = (100, 1000),
) -> dict[str, Any]:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the sweeps' processes
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        paths = make_tracks(folder, clips if {"clips", "workers"} & {*only} else 0)
        if "clips" in only:
            figures["clips"] = cost_of_clips(paths)
        if "workers" in only:
            figures["workers"] = cost_with_workers(folder, paths[: clips // 2])
        if "memory" in only:
            figures["memory"] = memory_of_cells(folder, method, cells)
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
        run_sweep(folder / f"workers_{count}", {"clips": [str(path) for path in paths]}, count)
        found[str(count)] = (time.perf_counter() - began) / len(paths)
        tables.row(str(count), (found[str(count)], found["1"] / found[str(count)]))
    return found


def memory_of_cells(folder: Path, method: str, cells: Sequence[int]) -> dict[str, Any]:
    """Peak resident memory of a sweep's processes, MB: one short track from many seeds."""
    path = folder / "short.csv"  # the cheapest of cells
    simulate(path, track_only=True, scenario="incline", seconds=0.4, fps=30.0, seed=0)
    found: dict[str, Any] = {"method": method}
    config: dict[str, Any] = {"clips": [str(path)], "common": {"method": method}}
    run_sweep(folder / "cells_first", config, 1)  # compiles, which takes memory of its own
    tables.row("cells", ("parent MB", "worker MB", "s per cell"))
    for count in cells:
        began = time.perf_counter()
        parent, worker = run_sweep(
            folder / f"cells_{count}", config | {"grid": {"seed": list(range(count))}}, 1
        )
        each = (time.perf_counter() - began) / count
        tables.row(str(count), (parent, worker, each))
        found[str(count)] = {"parent_mb": parent, "worker_mb": worker, "s_per_cell": each}
    few, many = (found[str(count)] for count in (cells[0], cells[-1]))
    found["ratio"] = {key: many[key] / few[key] for key in ("parent_mb", "worker_mb")}
    tables.row(f"{cells[-1]} over {cells[0]}", list(found["ratio"].values()))
    return found


# Peaks by /proc: getrusage counts what a process was before it became another program.
PEAKS = """
import json, os, sys, threading, time
from pathlib import Path
from galileo_jax.commands import command
from galileo_jax.commands import sweep

def peak_mb(process):
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return next(int(line.split()[1]) / 1024 for line in lines if line.startswith("VmHWM"))

def watch():
    while True:
        for path in Path("/proc/self/task").glob("*/children"):
            for child in path.read_text().split():
                try:
                    peaks[1] = max(peaks[1], peak_mb(child))
                except (OSError, StopIteration):
                    continue
        time.sleep(0.1)

peaks = [0.0, 0.0]
threading.Thread(target=watch, daemon=True).start()
code = command.run(sweep.main, sys.argv[1:])
print(json.dumps([peak_mb("self"), peaks[1]]))
sys.exit(code)
"""


def run_sweep(out: Path, config: dict[str, Any], workers: int) -> list[float]:
    """Runs a sweep; returns the peak memory of its parent and of its largest worker, MB."""
    out.mkdir(parents=True)
    (out / "config.yaml").write_text(json.dumps(config))  # YAML, too
    words = [str(out / "config.yaml"), "--out", str(out), "--workers", str(workers)]
    done = subprocess.run(
        [sys.executable, "-c", PEAKS, *words], check=True, stdout=subprocess.PIPE, text=True
    )
    return json.loads(done.stdout.splitlines()[-1])

"""What does a sweep cost?

    python -m benchmarks scaling [--only clips workers memory]

    clips     seconds per clip of `grad` against the number of clips, in one process, and what the
              clips after the first of their shape cost (the marginal cost); how often each program
              was compiled, which is once for each shape
    workers   seconds per clip of a sweep against its workers
    memory    peak memory of a sweep of 100 cells and of 1,000, of the parent and of the worker

Clips are csv tracks by `galileo simulate`. A shape is what programs are compiled for: numbers of
objects, frames (in steps of 64) and recorded instants (in steps of 128). Seconds are wall clock:
run it on a quiet machine. Rollouts per second are in `accelerator`.
"""

import argparse
import contextlib
import json
import logging
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import tables
from galileo_jax.api.simulate import simulate
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.measurement.measure import measure

CLIPS = (1, 2, 4, 8, 16, 32, 64)
CELLS = (100, 1000)
BARS = {"marginal_s": 3.0, "memory_ratio": 1.2}
HEAVY = ("_roll_out_batch", "seen_slopes_batch", "solve", "white_batch", "_seen_batch")
LOGGING = ("dispatch", "compiler", "interpreters.pxla")  # JAX's modules that tell of compilations
PARTS = ("clips", "workers", "memory")


def main(call: argparse.Namespace) -> dict[str, Any]:
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the sweeps' processes
    figures: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(call.folder or temporary)
        if {"clips", "workers"} & set(call.only):
            paths = make_tracks(folder, call.clips)
            if "clips" in call.only:
                figures["clips"] = cost_of_clips(paths)
            if "workers" in call.only:
                figures["workers"] = cost_with_workers(folder, paths[: call.clips // 2])
        if "memory" in call.only:
            figures["memory"] = memory_of_cells(folder, call.method, call.cells)
    return figures


def make_tracks(folder: Path, count: int) -> list[Path]:
    paths = [folder / f"track_{seed}.csv" for seed in range(count)]
    for seed, path in enumerate(paths):
        if not path.is_file():
            simulate(path, track_only=True, seed=seed)
    return paths


def make_short_track(folder: Path) -> Path:
    """A block on a slope for 0.4 s at 30 fps: the cheapest of cells."""
    path = folder / "short.csv"
    simulate(path, track_only=True, scenario="incline", seconds=0.4, fps=30.0, seed=0)
    return path


def cost_of_clips(paths: Sequence[Path]) -> dict[str, Any]:
    from galileo_jax.sweeping.settings import Grad
    from galileo_jax.sweeping.work import run_cell

    seconds, compiled = [], []
    shapes: Counter[tuple[int, ...]] = Counter()
    is_first = []
    tables.row("clips", ("s per clip", "shapes", "programs", "small ones"))
    total: Counter[str] = Counter()
    for i, path in enumerate(paths, 1):
        with compilations() as names:
            began = time.perf_counter()
            measured = measure(load_clip(path))
            run_cell(Grad(), (measured,))
            seconds.append(time.perf_counter() - began)
        shape = shape_of(measured)
        is_first.append(shape not in shapes)
        shapes[shape] += 1
        total.update(names)
        compiled.append(sum(names[name] for name in HEAVY))
        if i in CLIPS:
            heavy = sum(total[name] for name in HEAVY)
            small = sum(total.values()) - heavy
            tables.row(str(i), (float(np.mean(seconds)), len(shapes), heavy, small))
    if missing := [name for name in HEAVY if not total[name]]:
        raise RuntimeError(f"JAX logs no compilation of {missing}: HEAVY has other names")
    later = ~np.array(is_first)
    marginal = float(np.mean(np.array(seconds)[later]))
    surplus = int(np.array(compiled)[later].sum())
    print(f"marginal {marginal:.2f} s per clip (bar {BARS['marginal_s']:g}); "
          f"programs compiled by clips of a shape seen before: {surplus}")  # fmt: skip
    return {
        "seconds_per_clip": float(np.mean(seconds)),
        "marginal_s": marginal,
        "marginal_largest_s": float(np.max(np.array(seconds)[later])),
        "shapes": len(shapes),
        "programs": {name: total[name] for name in HEAVY},
        "programs_compiled_again": surplus,
    }


def shape_of(measured: Any) -> tuple[int, ...]:
    """What programs are compiled for: objects, frames, recorded instants."""
    from galileo_jax.inference.build_problem import make_problem
    from galileo_jax.rollout.engine_jax import RECORDS
    from galileo_jax.runtime.batching import FRAMES, rounded_up

    problem = make_problem(measured.clip, measured.observation)
    count, _, frames = measured.observation.position_m.shape
    return count, rounded_up(frames, FRAMES), rounded_up(problem.model.num_records + 1, RECORDS)


@contextlib.contextmanager
def compilations() -> Iterator[Counter[str]]:
    """Counts what JAX compiles (or reads from its cache on disk) inside, by name."""
    import jax

    names: Counter[str] = Counter()

    class Count(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            if found := re.match(r"Finished XLA compilation of jit\((\w+)\)", record.getMessage()):
                names[found[1]] += 1

    handler = Count()
    loggers = [logging.getLogger(f"jax._src.{name}") for name in LOGGING]
    jax.config.update("jax_log_compiles", True)
    for logger in loggers:
        logger.propagate = False  # nothing is printed
        logger.addHandler(handler)
    try:
        yield names
    finally:
        for logger in loggers:
            logger.removeHandler(handler)
            logger.propagate = True
        jax.config.update("jax_log_compiles", False)


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
    path = make_short_track(folder)
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
    print(f"{cells[-1]} cells against {cells[0]}: " + ", ".join(
        f"{key} {value:.3f}" for key, value in found["ratio"].items()
    ) + f" (bar {BARS['memory_ratio']:g})")  # fmt: skip
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


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", choices=PARTS, default=list(PARTS))
    parser.add_argument("--clips", type=command.whole_number(2), default=CLIPS[-1])
    parser.add_argument("--method", default="grad", help="of the cells whose memory is measured")
    parser.add_argument(
        "--cells", type=command.whole_number(1), nargs="+", default=CELLS, help="of the memory"
    )
    parser.add_argument("--folder", help="for clips and sweeps, kept there")

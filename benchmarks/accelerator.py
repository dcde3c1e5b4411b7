"""What is an accelerator worth?

    python benchmarks/accelerator.py

Runs on whatever `jax.devices()` has. By size of the batch, rollouts of a ramp clip of 1.2 s per
minute: the rigid engine and MJX on the device, and MuJoCo's C engine (`mujoco.batch`) on all cores
of the machine beside it. Then simulated tracks one after the other: fits per second and diagnoses
per minute, programs compiled; and fits per second of as many tracks at once, their batches merged
(`galileo sweep --together`).
"""

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import jax

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # it is called as a script, too
import galileo_jax as gx
from benchmarks import rollouts, tables
from galileo_jax.commands import command
from galileo_jax.runtime.precision import in_float64
from galileo_jax.sweeping.engine_together import EngineTogether
from galileo_jax.sweeping.task import Task

ENGINES = ("rigid", "mjx", "c")
SIZES = (1, 16, 256, 4096, 65536)
MOST_ON_CORES = 1024  # larger batches of the C engine are no faster per rollout


@in_float64
def main(
    *,
    engine: tuple[str, ...] = ENGINES,
    batch: tuple[int, ...] = SIZES,
    repeats: int = 3,
    fits: int = 20,
    diagnoses: int = 5,
    together: tuple[int, ...] = (8, 64),
    seed: int = 7100,
) -> dict[str, Any]:
    device = jax.devices()[0]
    figures: dict[str, Any] = {"device": f"{device.platform} {device.device_kind}"}
    tables.row("rollouts per minute", engine)
    for size in batch:
        found = {name: _rollouts_per_minute(name, size, repeats) for name in engine}
        figures[f"rollouts_per_minute_{size}"] = found
        tables.row(f"  batch {size}", list(found.values()))
    with tempfile.TemporaryDirectory() as folder:
        most = max(fits, diagnoses)
        clips = [_track(Path(folder), seed + i) for i in range(most + (most > 0))]
        figures["fits_per_s"] = _rate(gx.fit, clips[: fits + 1])
        figures["diagnoses_per_minute"] = 60 * _rate(gx.diagnose, clips[: diagnoses + 1])
        for num in together:
            figures[f"fits_per_s_together_{num}"] = _rate_together(Path(folder), seed, num)
    tables.summary(figures)
    return figures


def _rollouts_per_minute(name: str, size: int, repeats: int) -> float | None:
    """None where the batch was not tried."""
    if name == "c" and size > MOST_ON_CORES:
        return None
    seconds = rollouts.seconds(rollouts.batch_of(name, size), repeats)
    return 60 * size / seconds


def _track(folder: Path, seed: int) -> Path:
    path = folder / f"clip{seed}.csv"
    gx.simulate(path, seed=seed, track_only=True)
    return path


def _rate(function: Callable[..., Any], clips: Sequence[Path]) -> float:
    """Calls per second, after a first one that compiles; 0 if there is nothing else."""
    if len(clips) < 2:
        return 0.0
    function(clips[0])
    began = time.perf_counter()
    for clip in clips[1:]:
        function(clip)
    return (len(clips) - 1) / (time.perf_counter() - began)


def _rate_together(folder: Path, seed: int, num: int) -> float:
    """Fits per second of that many tracks at once, after a first time that compiles."""
    tasks = [Task(str(i), _fitted, (_track(folder, seed + i),)) for i in range(num)]
    for _ in range(2):
        began = time.perf_counter()
        failed = [one for one in EngineTogether(num).outcomes(tasks) if one.failure is not None]
        assert not failed, failed
    return num / (time.perf_counter() - began)


def _fitted(path: Path) -> dict[str, Any]:
    return gx.fit(path).result["parameters"]


if __name__ == "__main__":
    from benchmarks.__main__ import main as run

    raise SystemExit(command.run(run, ["accelerator", *sys.argv[1:]]))

"""How fast are the engines?

    python -m benchmarks rollouts [--mjx-batch 1 8 64]

Environment steps per second (one step of one scene; 1/960 s for MuJoCo's, 1/240 s for the rigid
engine and PyBullet), seconds of experiment simulated per second, and what the first batch costs
in a new process where the engine is compiled: without, and with, JAX's persistent cache. No
object comes to rest within the rollouts, so that no engine stops early. PyBullet builds its
world anew for every rollout, as the thesis did, on one core.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jax
import numpy as np

from benchmarks import tables
from galileo_jax.model.model import SUBSTEPS, Model
from galileo_jax.model.parameters import absent
from galileo_jax.model.scene.scene import compile_scene
from galileo_jax.rollout.engines import make_engine
from galileo_jax.runtime import compilation_cache
from galileo_jax.runtime.precision import in_float64
from galileo_jax.simulation.truth import Truth, draw_truth

DURATION_S = 1.2
SIZES = (1, 8, 64, 256)
GIVEN = {"m1": 0.5, "k1": 0.05, "m2": 0.3, "k2": 0.08}


@in_float64
def main(call: argparse.Namespace) -> dict[str, Any] | None:
    if call.time_compile:
        run = batch_of(call.time_compile, 8)
        began = time.perf_counter()
        run()
        print(time.perf_counter() - began)
        return None
    tables.row("engine, batch", ("steps/s", "sim s/s", "ms/rollout"))
    figures: dict[str, Any] = {"backend": jax.default_backend(), "repeats": call.repeats}
    model = _model(_truth())
    for name, sizes in {"rigid": SIZES, "c": SIZES, "mjx": call.mjx_batch}.items():
        steps = model.num_records * (1 if name == "rigid" else SUBSTEPS)
        for size in sizes:
            taken = seconds(batch_of(name, size), call.repeats)
            figures[f"{name}_{size}"] = _report(f"{name} {size}", size, steps, taken)
    figures["pybullet_1"] = _pybullet(_truth(), call.repeats)
    if not call.no_compile:
        for name in ("rigid", "mjx"):
            figures[f"{name}_first_batch_s"] = _first_seconds(name)
    return figures


def batch_of(name: str, size: int) -> Callable[[], object]:
    """A batch of rollouts with an engine, which differ by a per cent in every parameter."""
    engine = make_engine(name, _model(_truth()))
    theta = absent(engine.model.parameters)
    for parameter, value in GIVEN.items():
        theta[engine.model.index(parameter)] = value
    rng = np.random.default_rng(1)
    batch = theta * (1 + 0.01 * rng.uniform(-1, 1, (size, len(theta))))
    return lambda: engine.simulate(batch)


def _truth() -> Truth:
    return draw_truth(np.random.default_rng(0), 20.0, GIVEN)


def _model(truth: Truth) -> Model:
    scene = compile_scene(truth.surroundings, ["box", "box"], truth.objects)
    return Model(scene, DURATION_S)


def seconds(run: Callable[[], object], repeats: int) -> float:
    """The median of some runs after a first one that warms up."""
    run()
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return float(np.median(taken))


def _report(label: str, size: int, steps: int, seconds: float) -> dict[str, float]:
    figures = {
        "steps_per_s": size * steps / seconds,
        "simulated_s_per_s": size * DURATION_S / seconds,
        "ms_per_rollout": 1e3 * seconds / size,
    }
    tables.row(label, list(figures.values()))
    return figures


def _pybullet(truth: Truth, repeats: int) -> dict[str, float] | None:
    try:
        import pybullet  # pyright: ignore

        from benchmarks import bullet_scene
    except ImportError:
        tables.row("pybullet", ("not installed",))
        return None
    client = pybullet.connect(pybullet.DIRECT)
    steps = round(DURATION_S / bullet_scene.STEP_S)
    taken = seconds(lambda: bullet_scene.roll_out(truth, steps, client), repeats)
    pybullet.disconnect(client)
    return _report("pybullet 1", 1, steps, taken)


def _first_seconds(name: str) -> dict[str, float]:
    """The first batch in new processes: compiled without a cache, then from the cache."""
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, compilation_cache.SWITCH: folder}
        environment.pop("JAX_COMPILATION_CACHE_DIR", None)
        for what in ("cold", "cached"):
            done = subprocess.run(
                [sys.executable, "-m", "benchmarks", "rollouts", "--time-compile", name],
                cwd=Path(__file__).resolve().parents[1],
                env=environment,
                capture_output=True,
                text=True,
                check=True,
            )
            found[what] = float(done.stdout.split()[-1])
            tables.row(f"{name} first batch {what}", (f"{found[what]:.1f} s",))
    return found


def options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--mjx-batch", type=int, nargs="*", default=list(SIZES))
    parser.add_argument("--no-compile", action="store_true", help="leave out compile times")
    parser.add_argument("--time-compile", metavar="ENGINE", help="print one first batch only")

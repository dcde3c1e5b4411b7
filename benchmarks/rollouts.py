"""How fast are the engines?

    python -m benchmarks rollouts [--mjx-batch 1 8 64]

Environment steps per second (one step of one scene; 1/960 s for MuJoCo's, 1/240 s for the rigid
engine), seconds of experiment simulated per second, and ms for one rollout. No object comes to rest
within the rollouts, so that no engine stops early.
"""

import time
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

from benchmarks import tables
from galileo_jax.model.model import SUBSTEPS, Model
from galileo_jax.model.parameters import absent
from galileo_jax.model.scene.scene import Scene
from galileo_jax.rollout.engines import make_engine
from galileo_jax.runtime.precision import in_float64
from galileo_jax.simulation.truth import draw_truth

DURATION_S = 1.2
SIZES = (1, 8, 64, 256)
GIVEN = {"m1": 0.5, "k1": 0.05, "m2": 0.3, "k2": 0.08}
COLUMNS = ("steps/s", "sim s/s", "ms/rollout")


@in_float64
def main(*, repeats: int = 3, mjx_batch: tuple[int, ...] = SIZES) -> dict[str, Any]:
    tables.row("engine, batch", COLUMNS)
    figures: dict[str, Any] = {"backend": jax.default_backend(), "repeats": repeats}
    num_records = _model().num_records
    for name, sizes in {"rigid": SIZES, "c": SIZES, "mjx": mjx_batch}.items():
        steps = num_records * (1 if name == "rigid" else SUBSTEPS)
        for size in sizes:
            per_s = size / seconds(batch_of(name, size), repeats)
            told = (steps * per_s, DURATION_S * per_s, 1e3 / per_s)
            figures[f"{name}_{size}"] = dict(zip(COLUMNS, told, strict=True))
            tables.row(f"{name} {size}", told)
    return figures


def batch_of(name: str, size: int) -> Callable[[], object]:
    """A batch of rollouts with an engine, which differ by a per cent in every parameter."""
    engine = make_engine(name, _model())
    theta = absent(engine.model.parameters)
    for parameter, value in GIVEN.items():
        theta[engine.model.index(parameter)] = value
    rng = np.random.default_rng(1)
    batch = theta * (1 + 0.01 * rng.uniform(-1, 1, (size, len(theta))))
    return lambda: engine.simulate(batch)


def seconds(run: Callable[[], object], repeats: int) -> float:
    """The median of some runs after a first one that warms up."""
    run()
    taken = []
    for _ in range(repeats):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return float(np.median(taken))


def _model() -> Model:
    truth = draw_truth(np.random.default_rng(0), 20.0, GIVEN)
    return Model(Scene(truth.surroundings, truth.objects), DURATION_S)

"""The thesis's setting, which all scripts here share: scene, truths, sampler, measures, figures.

One fixed scene (galileo_jax/thesis/task.py): 20 degrees, 30 frames/s, 60 or 110 frames,
masses in (0, 1) and frictions in (0, 0.3), searched in (0, 1). What is observed are the centres
with noise that makes 0.01 m/s on the velocities. The engine is the rigid one, not Bullet as in the
thesis.
"""

import argparse
import functools
import sys
from collections.abc import Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
from benchmarks import tables
from galileo_jax.commands import command
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.samplers.driver import Settings, sample
from galileo_jax.neural.config import TrainConfig
from galileo_jax.report.style import matplotlib_style
from galileo_jax.runtime import compilation_cache
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.thesis.sampler import NUM_CHAINS, NUM_STEPS, Acceptance, Thesis, select
from galileo_jax.thesis.similarity import AbstractSimilarity, similarity_class
from galileo_jax.thesis.task import FPS, NAMES, ThesisTask

NOISE_M_S = 0.01
NOISE_M = NOISE_M_S / (FPS * np.sqrt(2))
SEEN_M = 0.01  # object 2 goes at least so far in every truth: else nothing tells k2 and the masses
NUM_GUESSES = 30
THESIS_DISTANCES = {"fitted": (0.43, 0.07), "guess": (0.78, 0.11)}  # L1, L2 on its real videos
QUANTITIES = (*NAMES, "phi")
NETWORKS = Path(__file__).parent / "networks"

row = tables.row


@dataclass(frozen=True)
class Experiment:
    """One truth and what is seen of it.

    Attributes:
      theta: `[4]`, m1, k1, m2, k2.
      clean_m: `[object, 2, frame + 1]`, centres.
      seen_m: likewise, with noise.
    """

    theta: np.ndarray
    clean_m: np.ndarray
    seen_m: np.ndarray

    @property
    def profile_m_s(self) -> np.ndarray:
        """Measured velocities, `[object, 2, frame]`."""
        return FPS * np.diff(self.seen_m, axis=-1)


@functools.cache
def task(frames: int) -> ThesisTask:
    """The thesis's scene, seen for so many frames."""
    config = {"preset": "thesis", "samples": 100, "batch": 1, "learning_rate": 1, "max_epochs": 1}
    return ThesisTask(TrainConfig.model_validate(config | {"frames": frames}))


def experiments(seed: int, count: int, frames: int, noise_m: float = NOISE_M) -> list[Experiment]:
    """Random truths in which object 2 is seen to move, and their noisy observations."""
    of_theta, of_noise = jax.random.split(jax.random.key(seed))
    theta = task(frames).draw(of_theta, 4 * count + 20)
    clean = task(frames).positions(theta)
    moved = np.flatnonzero(np.ptp(clean[:, 1, 0], axis=-1) > SEEN_M)[:count]
    noise = noise_m * np.asarray(jax.random.normal(of_noise, clean.shape))
    return [Experiment(theta[i], clean[i], clean[i] + noise[i]) for i in moved]


def profiles(theta: np.ndarray, frames: int) -> np.ndarray:
    """Velocities of rollouts, `[batch, object, 2, frame]`, m/s."""
    return FPS * np.diff(task(frames).positions(np.atleast_2d(theta)), axis=-1)


class LogSimilarity(eqx.Module):
    """How alike the profile that `theta` `[4]` makes and an observed one are."""

    observed_m_s: jax.Array
    measure: AbstractSimilarity
    frames: int = eqx.field(static=True)

    def __call__(self, theta: jax.Array) -> jax.Array:
        """The similarity `[]`."""
        made = task(self.frames)
        position, _ = made.engine.traceable(theta[None])  # pyright: ignore
        velocity = FPS * jnp.diff(made.at_frames(position)[0], axis=-1)
        return self.measure(velocity, self.observed_m_s, jnp.ones(velocity.shape[::2], bool))


def chains(
    experiment: Experiment,
    seed: int,
    *,
    similarity: str = "thesis_gaussian",
    acceptance: Acceptance = Acceptance.COIN,
    count: int = NUM_CHAINS,
) -> Posterior:
    """The thesis's chains of 75 steps from uniform starts (`thesis/sampler.py`)."""
    observed = jnp.asarray(experiment.profile_m_s)
    start_key, key = jax.random.split(jax.random.key(seed))
    return sample(
        key,
        Thesis(acceptance=acceptance),
        LogSimilarity(observed, similarity_class(similarity)(), observed.shape[-1]),
        jax.random.uniform(start_key, (count, len(NAMES)), minval=1e-6),
        NAMES,
        settings=Settings(warmup_steps=0, block_steps=25, max_steps=NUM_STEPS, stops_early=False),
    )


def infer(experiment: Experiment, seed: int) -> np.ndarray:
    """The thesis's estimate `[4]`: the best sample of 16 chains."""
    from galileo_jax.thesis.sampler import Selection

    return select(chains(experiment, seed), Selection.BEST)


def guesses(seed: int) -> np.ndarray:
    """The naive guesser: `[30, 4]`, uniform in (0, 1)."""
    return np.random.default_rng([seed, 1]).uniform(1e-3, 1.0, (NUM_GUESSES, len(NAMES)))


def distances(theta: np.ndarray, experiment: Experiment) -> tuple[float, float]:
    """L1 and L2 between the profiles of `theta` `[4]` or `[batch, 4]` and the observed one.

    The thesis gives no formula; read as plain sums over all numbers, in metres per frame. Of a
    batch: the mean.
    """
    seen = experiment.profile_m_s
    difference = (profiles(theta, seen.shape[-1]) - seen).reshape(len(np.atleast_2d(theta)), -1)
    difference = difference / FPS
    l1 = np.abs(difference).sum(axis=1).mean()
    return float(l1), float(np.sqrt((difference**2).sum(axis=1)).mean())


def quantities(theta: np.ndarray) -> np.ndarray:
    """`[..., 4]` with phi = (m1 - m2) / (m1 + m2) appended: `[..., 5]`."""
    m1, m2 = theta[..., 0], theta[..., 2]
    return np.concatenate([theta, ((m1 - m2) / (m1 + m2))[..., None]], axis=-1)


def errors(estimates: np.ndarray, truths: np.ndarray) -> np.ndarray:
    """Absolute errors of `QUANTITIES`, `[..., 5]`, of estimates `[..., 4]`."""
    return np.abs(quantities(estimates) - quantities(truths))


def start(argv: Sequence[str], doc: str | None, num: int, frames: int = 60) -> argparse.Namespace:
    """Reads the options that all scripts have, and prepares JAX."""
    parser = command.Parser(description=doc)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=command.whole_number(1), default=num, help="truths or runs")
    parser.add_argument("--frames", type=command.whole_number(25), default=frames)
    parser.add_argument("--seed", type=command.whole_number(0), default=0)
    parser.add_argument("--out", type=Path, default=Path("runs/thesis"), help="figures' folder")
    call = parser.parse_args(argv)
    jax.config.update("jax_enable_x64", True)
    compilation_cache.enable()
    return call


@contextmanager
def figure(
    call: argparse.Namespace, name: str, columns: int = 1, rows: int = 1, row_in: float = 2.7
):
    """Yields matplotlib axes `[row, column]`; the figure is then OUT/NAME.png."""
    from matplotlib.figure import Figure

    with matplotlib_style(name):
        drawn = Figure(figsize=(3.6 * columns, row_in * rows), dpi=110, layout="constrained")
        yield drawn.subplots(rows, columns, squeeze=False)
        with replacing(call.out / f"{name}.png") as temporary:
            drawn.savefig(temporary)


def finish(call: argparse.Namespace, name: str, figures: Mapping[str, Any]) -> None:
    """Prints where the figure is, and the JSON line."""
    print(f"{call.out / name}.png")
    options = {key: getattr(call, key) for key in ("num", "frames", "seed")}
    tables.finish(f"thesis/{name}", options | dict(figures))

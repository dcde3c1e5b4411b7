"""The thesis's setting in the form that the amortised posterior reads, and its test there."""

import functools

import jax
import jax.numpy as jnp
import numpy as np

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.galileo_task import QUANTITIES, to_sample
from galileo_jax.neural.seen import NUM_FRAMES, Seen
from galileo_jax.neural.task import BENCHMARKS, Arrays, Benchmark
from galileo_jax.neural.world import Truth
from galileo_jax.thesis.task import FPS, ThesisTask

TEST_NOISE_M = 2.2e-5  # 0.02 px at 900 px/m: the tracker's on the shared clips, at most


def thesis_clips(
    key: jax.Array, count: int, noise_m: float, stated_noise_m: float | None = None
) -> Arrays:
    """The thesis's setting, seen with a little noise, in the form `GalileoTask.make` gives.

    The network is told of `stated_noise_m`, by default the truth.

    Returns:
      the samples, and with them `collides`: whether object 2 moves by more than 0.1 mm.
    """
    config = TrainConfig(preset="thesis", samples=100, batch=1, learning_rate=1.0, max_epochs=1)
    setting = ThesisTask(config)
    of_theta, of_noise = jax.random.split(key)
    theta = setting.draw(of_theta, count)
    clean = setting.positions(theta)
    seen = clean + noise_m * np.asarray(jax.random.normal(of_noise, clean.shape))
    made = to_clips(theta, seen, setting.surroundings, stated_noise_m or noise_m)
    collides = np.ptp(clean[:, 1, 0], axis=-1) > 1e-4
    return made | {"collides": collides}


def to_clips(theta: np.ndarray, seen_m: np.ndarray, scene: Surroundings, noise_m: float) -> Arrays:
    """Samples of an ideal world, in the form `GalileoTask.make` gives.

    `theta` is `[sample, 4]` (m1, k1, m2, k2), `seen_m` `[sample, object, 2, frame]` at the thesis's
    frame rate.
    """
    frames = seen_m.shape[-1]
    missing = ((0, 0), (0, 0), (0, 0), (0, NUM_FRAMES - frames))
    times = np.arange(NUM_FRAMES) / FPS

    def one(position: jax.Array, theta: jax.Array):
        clip = Seen(
            times_s=jnp.asarray(times),
            position_m=position,
            mask=jnp.tile(jnp.arange(NUM_FRAMES) < frames, (2, 1)),
            noise_m=jnp.full(2, noise_m),
            angle_rad=jnp.asarray(scene.angle_rad),
            gravity=jnp.asarray(scene.gravity),
            half_length_m=jnp.asarray(scene.half_length_m),
            half_height_m=jnp.asarray(scene.half_height_m),
            is_ideal=jnp.ones(()),
            is_filmed=jnp.zeros(()),
            is_tracked_here=jnp.zeros(()),
        )
        return to_sample(clip, Truth(theta[1], theta[3], theta[0] / theta[2]))

    made = jax.jit(jax.vmap(one))(jnp.asarray(np.pad(seen_m, missing)), jnp.asarray(theta))
    return {name: np.asarray(values) for name, values in made.items()}


BENCHMARKS.register(
    Benchmark(
        name="thesis",
        draw=functools.partial(thesis_clips, noise_m=TEST_NOISE_M),
        reference={"k1 MAE": 0.0003, "k2 MAE": 0.006, "phi MAE": 0.02}
        | {f"{name} in 90 %": 0.9 for name in QUANTITIES},
    )
)

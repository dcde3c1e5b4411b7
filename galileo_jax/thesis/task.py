"""The thesis's setting and the network that it trained there.

One fixed scene at 20 degrees, no noise, masses and frictions uniform; a small CNN reads these off a
velocity profile.
"""

import functools

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from galileo_jax.clip.schema import ClipObject
from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.model.model import Model
from galileo_jax.model.scene.scene import Scene
from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.task import PRESETS, Arrays
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.rollout import Engine
from galileo_jax.simulation.truth import Truth

# Object 2 stands so close that it is nearly always hit; the thesis does not tell its distances.
NAMES = ("m1", "k1", "m2", "k2")
RAMP_ANGLE_DEG, FPS = 20.0, 30.0
SIZE_M, RELEASE_M, OBJECT2_M = (0.06, 0.06, 0.06), 0.5, 0.15
THESIS_MAE = dict(zip(NAMES, (0.1686, 0.0004, 0.1605, 0.0232), strict=True))
CM = 100.0
NUM_ROWS = 4  # x and y of both objects
KERNEL, POOL = 7, 2
FILTERS = (6, 16)
DENSE = (64, 32, 4)
RANGES = (1.0, 0.3, 1.0, 0.3)  # of m1 (kg), k1, m2 (kg), k2, from 0


def num_values(frames: int) -> int:
    """How many numbers reach the dense layers."""
    length = frames
    for _ in FILTERS:
        length = (length - KERNEL + 1) // POOL
    return FILTERS[-1] * length * (NUM_ROWS // POOL ** len(FILTERS))


class Convolution(nnx.Module):
    """A (1, 7) convolution along time without padding, `[batch, row, time, channel]`.

    As one product of matrices over shifted copies: on a CPU several times as fast as XLA's
    convolution of so few channels, and the same numbers.
    """

    def __init__(self, num_in: int, num_out: int, rngs: nnx.Rngs):
        self.filters = nnx.Linear(KERNEL * num_in, num_out, rngs=rngs)

    def __call__(self, x: jax.Array) -> jax.Array:
        """The filters' answers at every place where the kernel fits."""
        length = x.shape[2] - KERNEL + 1
        shifted = [x[:, :, i : i + length] for i in range(KERNEL)]
        return self.filters(jnp.concatenate(shifted, axis=-1))


class ThesisNetwork(nnx.Module):
    """Convolution, average pool, twice; three dense layers; ReLU between, linear output.

    13,252 parameters for 60 frames. Kernels are (1, 7), along time; pools are 2 x 2.
    """

    def __init__(self, frames: int, rngs: nnx.Rngs):
        first, second = FILTERS
        self.convolution1 = Convolution(1, first, rngs)
        self.convolution2 = Convolution(first, second, rngs)
        sizes = (num_values(frames), *DENSE)
        self.dense1 = nnx.Linear(sizes[0], sizes[1], rngs=rngs)
        self.dense2 = nnx.Linear(sizes[1], sizes[2], rngs=rngs)
        self.dense3 = nnx.Linear(sizes[2], sizes[3], rngs=rngs)

    def __call__(self, profile: jax.Array) -> jax.Array:
        """`[batch, 4, frame]`, displacements per frame, cm, to m1, k1, m2, k2 `[batch, 4]`."""
        x = profile[..., None]
        for convolution in (self.convolution1, self.convolution2):
            x = average_pool(nnx.relu(convolution(x)))
        x = x.reshape(len(x), -1)
        x = nnx.relu(self.dense2(nnx.relu(self.dense1(x))))
        return self.dense3(x)


def average_pool(x: jax.Array) -> jax.Array:
    """Means of 2 x 2 neighbours in rows and time; an odd last frame is left out."""
    batch, rows, length, channels = x.shape
    length //= POOL
    x = x[:, :, : POOL * length].reshape(batch, rows // POOL, POOL, length, POOL, channels)
    return x.mean(axis=(2, 4))


def log_mean_absolute_errors(network: ThesisNetwork, batch: dict[str, jax.Array]) -> jax.Array:
    """The thesis's loss, each of the four mean absolute errors in units of itself.

    That is the mean of their logarithms: the likelihood of Laplace's law with a width of its own
    for each number (Kendall, Gal and Cipolla 2018, arXiv 1705.07115). A plain sum would be that of
    the masses, of which a profile shows no more than the ratio, and frictions would hardly count.
    """
    error = jnp.abs(network(batch["profile"]) - batch["target"])
    return jnp.mean(jnp.log(jnp.mean(error, axis=0)))


@PRESETS.register
class ThesisTask:
    """Data, network and loss of preset `thesis`."""

    name = "thesis"
    loss = staticmethod(log_mean_absolute_errors)
    shard_size = 2000

    def __init__(self, config: TrainConfig):
        self.config = config

    def network(self, seed: int, data: Arrays | None = None) -> ThesisNetwork:
        """A new network."""
        del data
        return ThesisNetwork(self.config.frames, nnx.Rngs(seed))

    def draw(self, key: jax.Array, count: int) -> np.ndarray:
        """Masses and frictions from the thesis's priors, `[count, 4]`."""
        drawn = np.asarray(jax.random.uniform(key, (count, len(NAMES))))
        return np.array(RANGES) * np.maximum(drawn, 1e-3)  # a body of no mass at all has no motion

    def positions(self, theta: np.ndarray) -> np.ndarray:
        """Centres in every frame, `[count, object, 2, frames + 1]`, m."""
        stride = round(1 / (FPS * self.engine.model.record_dt_s))
        return self.engine.simulate(theta)[0][..., ::stride][..., : self.config.frames + 1]

    def make(self, key: jax.Array, count: int) -> Arrays:
        """`profile` `[sample, 4, frame]`, cm a frame, and `target` `[sample, 4]`."""
        theta = self.draw(key, count)
        moved = np.diff(self.positions(theta), axis=-1).reshape(count, 4, self.config.frames)
        return {"profile": (CM * moved).astype(np.float32), "target": theta.astype(np.float32)}

    @property
    def surroundings(self) -> Surroundings:
        """The scene's geometry."""
        return self.engine.model.scene.surroundings

    @functools.cached_property
    def engine(self) -> Engine:
        """Rolls the scene out; its parameters are `NAMES`."""
        return make_engine(self.config.engine, _model(self.config.frames))

    def test(self, network: ThesisNetwork, data: Arrays, seed: int) -> dict[str, float]:
        """Mean absolute errors by name."""
        del seed
        error = np.abs(np.asarray(network(data["profile"])) - data["target"])  # pyright: ignore
        return {f"{name} MAE": float(e) for name, e in zip(NAMES, error.mean(0), strict=True)}

    def reference(self) -> dict[str, float]:
        """The thesis's own table."""
        return {f"{name} MAE": value for name, value in THESIS_MAE.items()}


def _model(frames: int) -> Model:
    first, second = (ClipObject(name=f"object{i}", shape="box", size_m=SIZE_M) for i in (1, 2))
    truth = Truth(
        mass_kg=(0.4, 0.4),
        friction=(0.1, 0.1),
        ramp_angle_deg=RAMP_ANGLE_DEG,
        objects=(first, second),
        release_m=RELEASE_M,
        stand_x_m=(OBJECT2_M,),
    )
    return Model(Scene(truth.surroundings, truth.objects), frames / FPS, nuisances=())

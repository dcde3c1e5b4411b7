"""The thesis's network: a small CNN that reads masses and frictions off a velocity profile."""

import jax
import jax.numpy as jnp
from flax import nnx

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

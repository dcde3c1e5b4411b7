"""What a preset brings to the training loop."""

from typing import Any, Protocol

import jax
import numpy as np

Arrays = dict[str, np.ndarray]


class Trainable(Protocol):
    """Data, network and loss: what the training loop needs.

    Attributes:
      shard_size: samples made at a time, and kept in one file.
    """

    shard_size: int

    def network(self, seed: int, data: Arrays | None = None) -> Any:
        """A new network; `data`: the training samples that it is to know the spread of."""
        ...

    def make(self, key: jax.Array, count: int) -> Arrays:
        """New samples: arrays `[sample, ...]` by name."""
        ...

    def loss(self, network: Any, batch: dict[str, jax.Array]) -> jax.Array:
        """The mean loss of a batch."""
        ...


class Task(Trainable, Protocol):
    """A preset: it can be tested, too."""

    def test(self, network: Any, data: Arrays, seed: int) -> dict[str, float]:
        """What is to be told of a trained network on new samples."""
        ...

    def reference(self) -> dict[str, float]:
        """What others reach in the same test; may be empty."""
        ...

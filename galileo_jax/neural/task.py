"""What a preset brings to the training loop, the presets by name, and what they are tested on."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from galileo_jax.runtime.registry import Registry

if TYPE_CHECKING:
    import jax
    import numpy as np

    from galileo_jax.neural.config import TrainConfig

    Arrays = dict[str, np.ndarray]
else:
    Arrays = dict  # NumPy is left out: every command registers presets here, also for a --help


class Task(Protocol):
    """A preset: data, network and loss, and what a trained network is tested on."""

    shard_size: int  # samples made at a time, and kept in one file

    def network(self, seed: int, data: Arrays | None = None) -> Any:
        """A new network; `data`: the training samples that it is to know the spread of."""
        ...

    def make(self, key: "jax.Array", count: int) -> Arrays:
        """New samples: arrays `[sample, ...]` by name."""
        ...

    def loss(self, network: Any, batch: "dict[str, jax.Array]") -> "jax.Array":
        """The mean loss of a batch."""
        ...

    def test(self, network: Any, data: Arrays, seed: int) -> dict[str, float]:
        """What is to be reported of a trained network on new samples."""
        ...

    def reference(self) -> dict[str, float]:
        """What others reach in the same test; may be empty."""
        ...


@dataclass(frozen=True)
class Benchmark:
    """A setting to test a network in."""

    name: str  # in the registry, and before its figures
    # Makes so many samples from a key, in the form `GalileoTask.make` gives, and with them
    # `collides`: whether object 2 is hit
    draw: "Callable[[jax.Array, int], Arrays]"
    reference: Mapping[str, float]  # what is expected, by the figure's name


PRESETS: "Registry[Callable[[TrainConfig], Task]]" = Registry(
    "preset", "presets", "galileo_jax.neural.galileo_task"
)
BENCHMARKS: Registry[Benchmark] = Registry("benchmark", "benchmarks")


def make_task(config: "TrainConfig") -> Task:
    """The task of a config.

    Raises:
      InputError: the preset is unknown, or the config does not go with it.
    """
    return PRESETS[config.preset](config)

"""The presets of `galileo train` by name: each has its own data, network and loss."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from galileo_jax.runtime.registry import Registry

if TYPE_CHECKING:
    from galileo_jax.neural.config import TrainConfig
    from galileo_jax.neural.task import Task

PRESETS: "Registry[Callable[[TrainConfig], Task]]" = Registry(
    "preset", "presets", "galileo_jax.neural.galileo_task"
)


def make_task(config: "TrainConfig") -> "Task":
    """The task of a config.

    Raises:
      InputError: the preset is unknown, or the config does not go with it.
    """
    return PRESETS.get(config.preset)(config)

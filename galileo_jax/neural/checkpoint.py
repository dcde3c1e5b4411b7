"""Checkpoints (orbax, the config inside), and finished networks as one small file.

DIR/checkpoints/EPOCH   everything that training needs to go on
DIR/network.npz         weights and config of the best epoch, read without orbax
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from galileo_jax.neural.config import TrainConfig
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

CHECKPOINTS, NETWORK = "checkpoints", "network.npz"
KEPT = 2


class Progress(NamedTuple):
    """Where training stands.

    Attributes:
      epoch: epochs done.
      learning_rate: of the next.
      best: lowest validation loss; stale: epochs since.
      cuts: of the learning rate, so far.
      losses: `(training, validation)` of every epoch.
    """

    epoch: int
    learning_rate: float
    best: float
    stale: int
    cuts: int
    losses: tuple[tuple[float, float], ...]


class State(NamedTuple):
    """Weights, the best weights so far, and the optimiser's moments: PyTrees of arrays."""

    weights: Any
    best_weights: Any
    moments: Any


class Checkpoints:
    """The checkpoints of one training."""

    def __init__(self, folder: Path, config: TrainConfig):
        import orbax.checkpoint as ocp

        self._ocp = ocp
        self._config = config
        self._manager = ocp.CheckpointManager(
            (folder / CHECKPOINTS).resolve(),
            options=ocp.CheckpointManagerOptions(
                max_to_keep=KEPT, create=True, enable_async_checkpointing=False
            ),
        )

    def save(self, state: State, progress: Progress) -> None:
        """Writes a checkpoint; one that is cut short does not count."""
        notes = {"config": self._config.model_dump(), "progress": progress._asdict()}
        self._manager.save(
            progress.epoch,
            args=self._ocp.args.Composite(
                state=self._ocp.args.StandardSave(flatten(state)),
                notes=self._ocp.args.JsonSave(notes),
            ),
        )

    def restore(self, like: State) -> tuple[State, Progress] | None:
        """The latest checkpoint, in the shape of `like`; None where there is none.

        Raises:
          InputError: it is of another config.
        """
        latest = self._manager.latest_step()
        if latest is None:
            return None
        stored: Any = self._manager.restore(
            latest,
            args=self._ocp.args.Composite(
                state=self._ocp.args.StandardRestore(flatten(like)),
                notes=self._ocp.args.JsonRestore(),
            ),
        )
        config = TrainConfig(**stored.notes["config"])
        if config != self._config:
            changed = [k for k, v in config if getattr(self._config, k) != v]
            raise InputError(
                f"{self._manager.directory}: trained with another {', '.join(changed)}; "
                "take another --out"
            )
        progress = stored.notes["progress"]
        progress["losses"] = tuple(map(tuple, progress["losses"]))
        return unflatten(like, stored.state), Progress(**progress)

    def close(self) -> None:
        """Ends orbax's threads."""
        self._manager.close()


def flatten(tree: Any) -> dict[str, Any]:
    """A PyTree's leaves by their paths."""
    leaves, _ = jax.tree_util.tree_flatten_with_path(tree)
    return {jax.tree_util.keystr(path): leaf for path, leaf in leaves}


def unflatten(like: Any, leaves: dict[str, Any]) -> Any:
    """The inverse, for a tree of the same structure."""
    paths, structure = jax.tree_util.tree_flatten_with_path(like)
    found = [jnp.asarray(leaves[jax.tree_util.keystr(path)], leaf.dtype) for path, leaf in paths]
    return jax.tree_util.tree_unflatten(structure, found)


def save_network(path: Path, weights: Any, config: TrainConfig) -> None:
    """Writes a network's state and config."""
    arrays = {name: np.asarray(leaf) for name, leaf in flatten(weights).items()}
    with replacing(path) as temporary:
        arrays["config"] = np.array(json.dumps(config.model_dump()))
        np.savez(temporary, **arrays)  # pyright: ignore


def load_network(path: Path) -> tuple[Any, TrainConfig]:
    """Reads what `save_network` wrote.

    Raises:
      InputError: missing, or not a network of this version.
    """
    from galileo_jax.neural.task import make_task

    try:
        with np.load(path) as file:
            arrays = {name: file[name] for name in file.files}
        config = TrainConfig(**json.loads(str(arrays.pop("config"))))
        network = make_task(config).network(config.seed)
        like = nnx.state(network)
        nnx.update(network, unflatten(like, arrays))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not a trained network of this version ({error})") from error
    return network, config

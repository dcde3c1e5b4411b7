"""The checkpoint of a training and the finished network, each one file with its config.

DIR/checkpoint.npz      everything that training needs to go on
DIR/network.npz         weights and config of the best epoch
"""

import json
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from flax import nnx

from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.task import make_task
from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError

CHECKPOINT, NETWORK = "checkpoint.npz", "network.npz"


class Progress(NamedTuple):
    """Where training stands."""

    epoch: int  # epochs done
    learning_rate: float  # of the next
    best: float  # lowest validation loss; stale: epochs since
    stale: int
    cuts: int  # of the learning rate, so far
    losses: tuple[tuple[float, float], ...]  # `(training, validation)` of every epoch


class State(NamedTuple):
    """Weights, the best weights so far, and the optimiser's moments: PyTrees of arrays."""

    weights: Any
    best_weights: Any
    moments: Any


def save_checkpoint(folder: Path, state: State, progress: Progress, config: TrainConfig) -> None:
    """Writes the checkpoint of a training, in place of an earlier one."""
    notes = {"config": config.model_dump(), "progress": progress._asdict()}
    _save(folder / CHECKPOINT, flatten(state), {"notes": notes})


def load_checkpoint(
    folder: Path, like: State, config: TrainConfig
) -> tuple[State, Progress] | None:
    """The checkpoint, in the shape of `like`; None where there is none.

    Raises:
      InputError: it is of another config.
    """
    path = folder / CHECKPOINT
    if not path.is_file():
        return None
    arrays = _arrays(path)
    notes = json.loads(str(arrays.pop("notes")))
    stored = TrainConfig(**notes["config"])
    if stored != config:
        changed = [key for key, value in stored if getattr(config, key) != value]
        raise InputError(f"{path}: trained with another {', '.join(changed)}; take another --out")
    progress = notes["progress"] | {"losses": tuple(map(tuple, notes["progress"]["losses"]))}
    return unflatten(like, arrays), Progress(**progress)


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
    _save(path, flatten(weights), {"config": config.model_dump()})


def load_network(path: Path) -> tuple[Any, TrainConfig]:
    """Reads what `save_network` wrote.

    Raises:
      InputError: missing, or not a network of this version.
    """
    try:
        arrays = _arrays(path)
        config = TrainConfig(**json.loads(str(arrays.pop("config"))))
        network = make_task(config).network(config.seed)
        like = nnx.state(network)
        nnx.update(network, unflatten(like, arrays))
    except (OSError, ValueError, KeyError) as error:
        raise InputError(f"{path}: not a trained network of this version ({error})") from error
    return network, config


def _save(path: Path, leaves: dict[str, Any], more: dict[str, Any]) -> None:
    """Writes arrays and JSON documents, each by name; a file that is cut short does not count."""
    arrays = {name: np.asarray(leaf) for name, leaf in leaves.items()}
    documents = {name: np.array(json.dumps(document)) for name, document in more.items()}
    with replacing(path) as temporary:
        np.savez(temporary, **arrays, **documents)  # pyright: ignore


def _arrays(path: Path) -> dict[str, np.ndarray]:
    with np.load(path) as file:
        return {name: file[name] for name in file.files}

"""A trained network's errors on samples that it has never been trained with."""

from pathlib import Path
from typing import NamedTuple

from galileo_jax.neural.checkpoint import NETWORK, load_network
from galileo_jax.neural.dataset import make_samples
from galileo_jax.neural.task import make_task
from galileo_jax.runtime.atomic_write import write_json

NUM_TEST = 1000
TEST_SHARD = 2**30  # beyond any training set's


class Evaluation(NamedTuple):
    """What a test found."""

    # Measure to its value, such as a mean absolute error in the parameter's unit
    found: dict[str, float]
    reference: dict[str, float]  # what others reach in the same test; may be empty
    num_samples: int = NUM_TEST  # on which it was tested


def evaluate_network(path: Path) -> Evaluation:
    """Tests a network on `NUM_TEST` new samples; in a training's folder it writes test.json.

    Raises:
      InputError: there is no network of this version.
    """
    network, config = load_network(path / NETWORK if path.is_dir() else path)
    task = make_task(config)
    data = make_samples(task, config.seed, TEST_SHARD, NUM_TEST)
    done = Evaluation(task.test(network, data, config.seed), task.reference())
    if path.is_dir():
        write_json(path / "test.json", {"found": done.found, "reference": done.reference})
    return done

"""A data set on disk, made shard by shard: what is there is kept, what is missing is made."""

import hashlib
import json
from pathlib import Path
from typing import Any

import jax
import numpy as np

from galileo_jax.neural.config import TrainConfig
from galileo_jax.neural.task import Arrays, Task
from galileo_jax.runtime.atomic_write import replacing, write_json
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import report

INDEX = "data.json"
DATA_KEYS = ("preset", "seed", "engine", "frames")  # what the samples depend on


def load_or_make(task: Task, config: TrainConfig, folder: Path) -> Arrays:
    """All samples of a config, from `folder` or made now; reports "simulating" after each shard.

    `task`: makes samples. `config`: says how many; the same config gives the same samples.
    `folder`: `shard_NNNNN.npz`, and the settings that they were made with.

    Raises:
      InputError: the folder holds samples of other settings.
    """
    identity: dict[str, Any] = {"settings": {key: getattr(config, key) for key in DATA_KEYS}}
    identity["digest"] = hashlib.sha256(json.dumps(identity).encode()).hexdigest()[:16]
    index = folder / INDEX
    if index.is_file() and json.loads(index.read_text(encoding="utf-8")) != identity:
        raise InputError(
            f"{folder}: contains samples of other settings; remove it or give another --out"
        )
    write_json(index, identity)
    count = -(-config.samples // task.shard_size)
    shards = []
    for number in range(count):
        path = folder / f"shard_{number:05d}.npz"
        if not path.is_file():
            made = make_samples(task, config.seed, number, task.shard_size)
            with replacing(path) as temporary:
                np.savez(temporary, **made)  # pyright: ignore
        with np.load(path) as file:
            shards.append({name: file[name] for name in file.files})
        report("simulating", (number + 1) / count)
    joined = {name: np.concatenate([shard[name] for shard in shards]) for name in shards[0]}
    return {name: values[: config.samples] for name, values in joined.items()}


def make_samples(task: Task, seed: int, shard: int, count: int) -> Arrays:
    """New samples; every shard has its own stream of random numbers."""
    return task.make(jax.random.fold_in(jax.random.key(seed), shard), count)

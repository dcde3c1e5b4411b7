"""A batch over all devices of the process."""

from collections.abc import Callable
from typing import Any

import jax
import numpy as np
from jax.sharding import Mesh, PartitionSpec


def over_devices(function: Callable[..., Any], num_rows: int) -> Callable[..., Any]:
    """`function` with its batch spread over the devices, as evenly as rows of a table.

    Each device works off its own part: a loop that ends early in one waits for no other.

    Args:
      function: maps a batch `[row, ...]` and what all rows share to a PyTree of `[row, ...]`.
      num_rows: of the batch.

    Returns:
      `function` itself where there is one device, or where the rows cannot be shared out evenly.
    """
    devices = jax.local_devices()
    if len(devices) == 1 or num_rows % len(devices):
        return function
    rows = PartitionSpec("row")
    mesh = Mesh(np.array(devices), ("row",))
    return jax.shard_map(
        function, mesh=mesh, in_specs=(rows, PartitionSpec()), out_specs=rows, check_vma=False
    )

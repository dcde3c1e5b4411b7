"""Batches of any size through programs compiled for a few."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np


def in_chunks(sizes: Sequence[int], function: Callable[..., Any], *batches: Any) -> Any:
    """Calls `function` for parts of a batch whose sizes are all in `sizes`.

    Args:
      sizes: ascending; every one of them costs a compilation.
      function: maps arrays `[size, ...]` (PyTrees of them) to a PyTree of arrays `[size, ...]`.
      *batches: PyTrees of arrays `[batch, ...]`.

    Returns:
      What one call for the whole batch would, as NumPy arrays. The last part repeats its first
      row until it has one of the sizes.
    """
    count = len(jax.tree.leaves(batches[0])[0])
    parts, begin = [], 0
    while begin < count:
        left = count - begin
        size = next((size for size in sizes if size >= left), sizes[-1])
        taken = min(size, left)
        index = np.arange(begin, begin + taken)
        index = np.concatenate([index, np.full(size - taken, begin)])
        out = function(*jax.tree.map(lambda leaf, rows=index: np.asarray(leaf)[rows], batches))
        parts.append(jax.tree.map(lambda leaf, kept=taken: np.asarray(leaf)[:kept], out))
        begin += taken
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)

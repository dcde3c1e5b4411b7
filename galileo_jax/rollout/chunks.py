"""Batches and lengths of any size through programs compiled for a few."""

from collections.abc import Callable, Sequence
from typing import Any

import jax
import numpy as np

# Sizes are rounded up to multiples of these, so that few programs serve all clips.
FRAMES, MODES, RECORDS = 64, 64, 512
MOTIONS = (16, 64, 256)  # of batches of rollouts


def rounded_up(size: int, multiple: int) -> int:
    """The next multiple."""
    return -(-size // multiple) * multiple


def padded_motion(position: np.ndarray, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Motions `[..., record]` as long as programs are compiled for; at rest beyond their end."""
    count = position.shape[-1]
    missing = [(0, 0)] * (position.ndim - 1) + [(0, rounded_up(count, RECORDS) - count)]
    return np.pad(position, missing, mode="edge"), np.pad(velocity, missing)


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

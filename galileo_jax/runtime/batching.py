"""Batches and lengths of any size through programs compiled for a few."""

import functools
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import jax
import numpy as np

from galileo_jax.runtime import call_merging

# Sizes are rounded up to multiples of these, so that few programs serve all clips.
FRAMES, RECORDS = 64, 512
SPARE_MODES = 128  # beside one per object and frame
MOTIONS = (16, 64)  # of batches of rollouts
# Three parts a quarter as large, side by side, are done sooner than a large one a quarter empty.
FILLED = 0.75
_LAPACK = threading.Lock()


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
      row until it has one of the sizes. Parts run side by side, one per core.
    """
    is_plain = all(isinstance(batch, np.ndarray) for batch in batches)
    count = len(batches[0] if is_plain else jax.tree.leaves(batches[0])[0])
    cuts = list(_cuts(count, sizes))
    is_64_bit = jax.config.read("jax_enable_x64")  # may be the calling thread's own

    def part(begin: int, end: int, size: int) -> Any:
        rows: Any = slice(begin, end)
        if size > end - begin:
            rows = np.concatenate([np.arange(begin, end), np.full(size - (end - begin), begin)])
        with jax.enable_x64(is_64_bit):
            if is_plain:  # as most are; mapping trees takes as long as a short rollout
                own = [batch[rows] for batch in batches]
            else:
                own = jax.tree.map(lambda leaf: np.asarray(leaf)[rows], batches)
            out = function(*own)
            return jax.tree.map(lambda leaf: np.asarray(leaf)[: end - begin], out)

    if len(cuts) == 1:
        return jax.tree.map(np.array, part(*cuts[0]))  # JAX's own cannot be written to
    if call_merging.current() is not None:  # its calls are made with those of other threads
        parts = [part(*cut) for cut in cuts]
    else:  # XLA runs small operations, one after the other, on a single core
        parts = list(_pool(os.getpid()).map(lambda cut: part(*cut), cuts))
    return jax.tree.map(lambda *leaves: np.concatenate(leaves), *parts)


def side_by_side(parts: Sequence[Callable[[], Any]]) -> None:
    """Calls functions of no arguments in threads of their own, and waits for all of them.

    Programs are read from JAX's cache, or compiled, without Python: several at once take as long
    as one.
    """
    is_64_bit = jax.config.read("jax_enable_x64")  # may be the calling thread's own

    def call(part: Callable[[], Any]) -> None:
        with jax.enable_x64(is_64_bit):
            part()

    with ThreadPoolExecutor(num_cores()) as pool:
        list(pool.map(call, parts))


@functools.cache
def _pool(process: int) -> ThreadPoolExecutor:
    """Threads for parts of batches: starting them anew takes as long as some parts do."""
    return ThreadPoolExecutor(num_cores())


def one_at_a_time(function: Callable[..., Any]) -> Callable[..., Any]:
    """`function`, a compiled program, run by one thread of the process at a time, to its end.

    For programs that hold LAPACK routines over a batch (`vmap` of a Cholesky factor, QR, inverse).
    On a CPU each of these waits, on a thread of XLA's pool, for work that it hands to the same
    pool: as many of them side by side as the pool has threads wait for ever (jaxlib 0.10,
    `ParallelBatchMap`; seen with two fits in two threads on two cores).
    """

    def alone(*args: Any) -> Any:
        if call_merging.current() is not None:  # one thread makes all calls, and all others wait
            return function(*args)
        with _LAPACK:
            return jax.block_until_ready(function(*args))

    return alone


def num_cores() -> int:
    """Of those that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _cuts(count: int, sizes: Sequence[int]) -> Iterator[tuple[int, int, int]]:
    """Begin, end and padded size of each part: of the largest size that is filled so far."""
    begin = 0
    while begin < count:
        left = count - begin
        size = next((size for size in reversed(sizes) if left > FILLED * size), sizes[0])
        end = begin + min(size, left)
        yield begin, end, size
        begin = end

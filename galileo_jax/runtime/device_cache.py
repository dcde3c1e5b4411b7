"""Data that programs are called with again and again, handed to JAX once.

A program that is given NumPy arrays copies each of them with every call: of the data of a clip,
some thirty arrays, that takes as long as sixteen short rollouts.
"""

from typing import Any, Generic, TypeVar

import jax
import jax.numpy as jnp
import numpy as np

T = TypeVar("T")


class OnDevice(Generic[T]):
    """A PyTree of arrays; called, it gives the same tree of JAX's arrays.

    One for each precision: that may be the calling thread's own.
    """

    def __init__(self, tree: T):
        self._tree = tree
        self._held: dict[Any, T] = {}

    def __call__(self) -> T:
        """The arrays, in the precision that holds now."""
        is_64_bit = jax.config.read("jax_enable_x64")
        if is_64_bit not in self._held:
            self._held[is_64_bit] = jax.tree.map(
                lambda leaf: jnp.asarray(np.asarray(leaf)), self._tree
            )
        return self._held[is_64_bit]

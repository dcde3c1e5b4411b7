"""JAX in 64 bit, as in the commands: for every thread, and only for a while."""

from collections.abc import Iterator
from contextlib import contextmanager

import jax


@contextmanager
def in_64_bit() -> Iterator[None]:
    """Switches the process; `jax.enable_x64` would switch this thread alone."""
    before = jax.config.read("jax_enable_x64")
    jax.config.update("jax_enable_x64", True)
    try:
        yield
    finally:
        jax.config.update("jax_enable_x64", before)

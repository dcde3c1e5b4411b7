"""How JAX runs under the public functions: compiled programs cached, never on one thread alone."""

import functools
import os

from galileo_jax.runtime import compilation_cache

LEAST_THREADS = 2


@functools.cache
def set_up() -> None:
    """Sets it once per process, before JAX computes anything."""
    from galileo_jax.runtime.batching import num_cores

    # Compiled chains call MuJoCo's engines back, and these run JAX themselves: with one thread,
    # as many as cores, it would wait for ever for the thread that waits for it. XLA reads NPROC.
    given = os.environ.get("NPROC", "")
    if (int(given) if given.isdigit() else num_cores()) < LEAST_THREADS:
        os.environ["NPROC"] = str(LEAST_THREADS)
    compilation_cache.enable()

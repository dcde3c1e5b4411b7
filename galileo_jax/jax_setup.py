"""How JAX runs in the commands: in 64 bit, programs kept, and never on one thread alone."""

import os

from galileo_jax import jax_cache

LEAST_THREADS = 2


def set_up() -> None:
    """Sets it, before JAX computes anything."""
    import jax

    from galileo_jax.rollout.chunks import num_cores

    jax.config.update("jax_enable_x64", True)
    # Compiled chains call MuJoCo's engines back, and these run JAX themselves: with one thread,
    # as many as cores, it would wait for ever for the thread that waits for it. XLA reads NPROC.
    told = os.environ.get("NPROC", "")
    if (int(told) if told.isdigit() else num_cores()) < LEAST_THREADS:
        os.environ["NPROC"] = str(LEAST_THREADS)
    jax_cache.enable()

"""How JAX runs under the public functions: programs cached, loops compiled whole, two threads."""

import functools
import os

from galileo_jax.runtime import compilation_cache

LEAST_THREADS = 2
# XLA runs a loop's body as some sixty small kernels, each dispatched anew: three quarters of a
# rollout's time. Loops that touch fewer bytes than this become one kernel (1 kB by default).
WHOLE_LOOPS = "xla_cpu_small_while_loop_byte_threshold=100000000"
EXTRA_OPTIONS = "--xla_backend_extra_options="


@functools.cache
def set_up() -> None:
    """Sets it once per process, before JAX computes anything."""
    from galileo_jax.runtime.batching import num_cores

    # Compiled chains call MuJoCo's engines back, and these run JAX themselves: with one thread,
    # as many as cores, it would wait for ever for the thread that waits for it. XLA reads NPROC.
    given = os.environ.get("NPROC", "")
    if (int(given) if given.isdigit() else num_cores()) < LEAST_THREADS:
        os.environ["NPROC"] = str(LEAST_THREADS)
    compile_loops_whole()
    compilation_cache.enable()


def compile_loops_whole() -> None:
    """Sets the flag that XLA reads once, before its first use.

    Whoever has set such options already keeps them.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if EXTRA_OPTIONS not in flags:
        os.environ["XLA_FLAGS"] = f"{flags} {EXTRA_OPTIONS}{WHOLE_LOOPS}".strip()

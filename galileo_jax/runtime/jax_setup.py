"""How JAX runs under the public functions: programs cached, XLA's flags, two threads."""

import functools
import os
import warnings
from importlib.metadata import version
from pathlib import Path

import platformdirs

SWITCH = "GALILEO_JAX_CACHE"
LEAST_THREADS = 2
# XLA runs a loop's body as some sixty small kernels, each dispatched anew: three quarters of a
# rollout's time. Loops that touch fewer bytes than this become one kernel (1 kB by default).
WHOLE_LOOPS = "xla_cpu_small_while_loop_byte_threshold=100000000"
EXTRA_OPTIONS = "--xla_backend_extra_options="
# With XLA's newer emitters of fused loops a first `fit` takes 31 CPU seconds instead of 22, and a
# later one as many as without them. A flag that a jaxlib does not know ends the process: only those
# that are known to know it are told.
FUSION_EMITTERS = "--xla_cpu_use_fusion_emitters="
KNOW_FUSION_EMITTERS = "0.10."


@functools.cache
def set_up() -> None:
    """Sets it once per process, before JAX computes anything."""
    from galileo_jax.runtime.batching import num_cores

    # Compiled chains call MuJoCo's engines back, and these run JAX themselves: with one thread,
    # as many as cores, it would wait for ever for the thread that waits for it. XLA reads NPROC.
    given = os.environ.get("NPROC", "")
    if (int(given) if given.isdigit() else num_cores()) < LEAST_THREADS:
        os.environ["NPROC"] = str(LEAST_THREADS)
    set_xla_flags()
    enable_cache()


def set_xla_flags() -> None:
    """Sets the flags that XLA reads once, before its first use.

    Whoever has set such a flag already keeps it.
    """
    flags = os.environ.get("XLA_FLAGS", "")
    if FUSION_EMITTERS not in flags and version("jaxlib").startswith(KNOW_FUSION_EMITTERS):
        flags += f" {FUSION_EMITTERS}False"
    if EXTRA_OPTIONS not in flags:
        flags += f" {EXTRA_OPTIONS}{WHOLE_LOOPS}"
    os.environ["XLA_FLAGS"] = flags.strip()


def cache_folder() -> Path | None:
    """Returns the folder for compiled programs; None where the cache is switched off.

    By default ``jax`` in the user's cache folder (``~/.cache/galileo_jax`` on Linux). The
    environment variable ``GALILEO_JAX_CACHE`` overrides it: ``off``, or another folder.
    """
    setting = os.environ.get(SWITCH, "")
    if setting.lower() == "off":
        return None
    if setting:
        return Path(setting).expanduser()
    return Path(platformdirs.user_cache_dir("galileo_jax", appauthor=False)) / "jax"


def enable_cache() -> None:
    """Turns the cache on for this process; commands call it, importing the package does not.

    A folder already set for JAX (``JAX_COMPILATION_CACHE_DIR``) is left as it is. The cache
    can be deleted at any time.
    """
    import jax

    # Of what another process is just writing JAX reads a part, and compiles it itself instead.
    warnings.filterwarnings("ignore", message="Error reading persistent compilation cache entry")
    folder = cache_folder()
    if folder is None:
        jax.config.update("jax_enable_compilation_cache", False)
    elif not os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        jax.config.update("jax_compilation_cache_dir", str(folder))
        # Small programs too: there are many, and reading one takes a few milliseconds.
        jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
        jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)

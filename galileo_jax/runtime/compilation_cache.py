"""JAX's persistent compilation cache: what was compiled once starts fast the next time."""

import os
import warnings
from pathlib import Path

import platformdirs

SWITCH = "GALILEO_JAX_CACHE"


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


def enable() -> Path | None:
    """Turns the cache on for this process; commands call it, importing the package does not.

    A folder already set for JAX (``JAX_COMPILATION_CACHE_DIR``) is left as it is. The cache
    can be deleted at any time.

    Returns:
      The folder in use, or None where the cache is switched off.
    """
    import jax

    # Of what another process is just writing JAX reads a part, and compiles it itself instead.
    warnings.filterwarnings("ignore", message="Error reading persistent compilation cache entry")
    folder = cache_folder()
    if folder is None:
        jax.config.update("jax_enable_compilation_cache", False)
        return None
    if configured := os.environ.get("JAX_COMPILATION_CACHE_DIR"):
        return Path(configured)
    jax.config.update("jax_compilation_cache_dir", str(folder))
    # Small programs too: there are many, and reading one takes a few milliseconds.
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
    return folder

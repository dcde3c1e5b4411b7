"""What all tests share: where JAX runs, its cache, and the data beside the checkout."""

import os
from pathlib import Path

import pytest

from galileo_jax.runtime.compilation_cache import cache_folder

# Before anything imports jax; the commands' own subprocesses inherit it.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
# Small matrices: BLAS's threads wait for each other longer than they compute.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
if folder := cache_folder():
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.5")

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture
def shared_data() -> Path:
    """The development data beside the checkout; a test that needs it is skipped without it."""
    if not SHARED_DATA.is_dir():
        pytest.skip("no ../shared/data beside this checkout")
    return SHARED_DATA


@pytest.fixture
def x64():
    """64-bit JAX for one test: derivatives are checked in it."""
    import jax

    with jax.enable_x64(True):
        yield


@pytest.fixture(scope="session")
def browser():
    """One browser for all pages."""
    from tests.report.browser import started

    with started() as found:
        yield found

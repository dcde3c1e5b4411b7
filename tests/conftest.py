"""What all tests share: where JAX runs, its cache, and the data beside the checkout."""

import contextlib
import ctypes
import gc
import math
import os
import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

from galileo_jax.commands import command
from galileo_jax.runtime.jax_setup import cache_folder, set_xla_flags
from tests.missing import find_shared_data, is_missing

# Before anything imports jax; the commands' own subprocesses inherit it.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
# Small matrices: BLAS's threads wait for each other longer than they compute.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
set_xla_flags()  # as under the public functions, also in tests that call no such one
if folder := cache_folder():
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(folder))
    # Small programs too, as under the commands: what one process compiled the others read.
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")

# A slow command says in a pipe how far it is: whether a machine is that slow is no result.
command.FIRST_LINE_S = math.inf

# No test depends on time, on how fast the machine is, or on what it compiles on the way.
settings.register_profile("suite", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("suite")


# A process that holds more drops what it has compiled. A file of tests adds up to 1 GB.
MOST_RESIDENT_BYTES = 1.5 * 2**30


@pytest.fixture(scope="module", autouse=True)
def compiled_programs_are_not_kept_for_ever():
    """One process runs thousands of tests; those of other files are read again."""
    yield
    if "jax" in sys.modules and _resident_bytes() > MOST_RESIDENT_BYTES:
        sys.modules["jax"].clear_caches()
        gc.collect()
        _give_back_freed()


def _give_back_freed() -> None:
    """Freed memory to the system; glibc keeps what lies between the compiler's small pieces.

    Else a process that was once too large would stay so, and drop its programs after every file.
    """
    if sys.platform == "linux":
        with contextlib.suppress(AttributeError):  # another C library
            ctypes.CDLL(None).malloc_trim(0)


def _resident_bytes() -> int:
    """Of this process; 0 where the system does not say."""
    pages = Path("/proc/self/statm")
    if not pages.is_file():
        return 0
    return int(pages.read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture
def shared_data() -> Path:
    """The development data beside the checkout; see `missing` for where there are none."""
    return find_shared_data()


@pytest.fixture
def nobody_can_write() -> Path:
    """A folder in which no file can be made, not even by root, to whom permissions are no bar."""
    folder = Path("/sys")
    if not folder.is_dir():
        is_missing("no /sys here")
    return folder


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

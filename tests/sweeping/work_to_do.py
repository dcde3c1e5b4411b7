"""Tasks for engines: importable by workers, and quick."""

import os
import signal
import time
from pathlib import Path

from galileo_jax.runtime.errors import InputError


def double(number: int) -> int:
    if number < 0:
        raise InputError("number: negative;\n  0 or more expected")
    return 2 * number


def divide(number: int) -> float:
    return 1 / number


def die(marks: Path, times: int) -> str:
    """Kills its process the first `times` times."""
    mark = marks / f"{len(list(marks.iterdir()))}"
    if int(mark.name) >= times:
        return "alive"
    mark.touch()
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError("unreachable")


def environment(name: str) -> str | None:
    return os.environ.get(name)


def slow_double(number: int, folder: str) -> int:
    """Leaves a mark with the number and its process."""
    Path(folder, f"{number}_{os.getpid()}").touch()
    time.sleep(0.5)
    return 2 * number

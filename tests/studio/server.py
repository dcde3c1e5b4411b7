"""The studio as a process of its own, as a person starts it."""

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlsplit


@dataclass
class Server:
    """A running studio."""

    process: subprocess.Popen
    address: str

    @property
    def port(self) -> int:
        """Where it listens."""
        return urlsplit(self.address).port or 0

    @property
    def token(self) -> str:
        """Of the address that it printed."""
        return urlsplit(self.address).query.removeprefix("token=")


@contextmanager
def started(folder: Path, **environ: str) -> Iterator[Server]:
    """`galileo studio FOLDER --no-browser`."""
    words = [sys.executable, "-m", "galileo_jax", "studio", str(folder), "--no-browser"]
    process = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        env={**os.environ, **environ},
    )  # fmt: skip
    try:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:"), "the studio did not start"
        yield Server(process, address)
    finally:
        process.terminate()
        process.wait(20)
        if process.stdout is not None:
            process.stdout.close()

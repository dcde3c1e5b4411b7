"""Writing files so that nothing is ever left half-written."""

import json
import math
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from galileo_jax.runtime.errors import InputError, one_line_of

_unfinished: set[Path] = set()
"""Temporary files that are being written, by any thread."""


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yields a temporary path beside `path` and renames it to `path` on success.

    The temporary name keeps the suffix, so that writers which choose their format by
    suffix (OpenCV, netCDF) work. On an exception, Ctrl-C included, the temporary file
    is removed and an older `path` stays as it was.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    _unfinished.add(temporary)
    try:
        yield temporary
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)
        _unfinished.discard(temporary)


def remove_unfinished() -> None:
    """Removes what is half-written, where the program ends without coming back to `replacing`."""
    for temporary in tuple(_unfinished):
        temporary.unlink(missing_ok=True)


@contextmanager
def writing_into(out: Path) -> Iterator[None]:
    """Refuses a folder that cannot be written to, before and while files are written inside."""
    check_folder(out)
    with one_line_of(f"--out: {out}"):
        yield


def check_folder(out: Path) -> None:
    """Refuses, before anything is computed, a folder that cannot be there or be written to.

    It makes a file without a name in the nearest folder that there is: permissions alone do not
    say it (to root everything is permitted, on a read-only disk, too).
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"--out: {out} is a file; a folder expected")
    nearest = next((folder for folder in (out, *out.parents) if folder.exists()), out)
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise InputError(f"--out: nothing can be written to {out} ({error.strerror})") from error


def write_text(path: Path, text: str) -> None:
    """Writes `text` to `path` in one step (temporary name, then rename)."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_json(path: Path, value: Any) -> None:
    """Writes `value` as strict JSON; non-finite numbers become null."""
    write_text(path, json.dumps(finite(value), indent=2, allow_nan=False) + "\n")


def finite(value: Any) -> Any:
    """A value as strict JSON has it: plain lists and numbers, null for what is not finite."""
    if isinstance(value, dict):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if hasattr(value, "tolist"):
        return finite(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value

"""The one small file of the studio's own: undo, and of which marks a result was made.

Everything else lies in the files of the commands. Where this file is missing or damaged only undo
is lost.
"""

import copy
import functools
import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from galileo_jax.clip.yaml_file import read_mapping
from galileo_jax.runtime.atomic_write import write_json
from galileo_jax.runtime.errors import InputError

FILE = ".galileo_studio.json"
MAX_BYTES = 20_000_000


class Store:
    """A mapping in a file, written at once and completely."""

    def __init__(self, root: Path):
        self._path = root / FILE
        self._content: dict[str, Any] = {}
        try:
            if self._path.stat().st_size <= MAX_BYTES and not self._path.is_symlink():
                found = json.loads(self._path.read_text(encoding="utf-8"))
                self._content = found if isinstance(found, dict) else {}
        except (OSError, ValueError):
            pass

    def get(self, kind: str, name: str) -> dict[str, Any]:
        """An entry; empty where there is none."""
        found = self._content.get(kind, {})
        entry = found.get(name, {}) if isinstance(found, dict) else {}
        return dict(entry) if isinstance(entry, dict) else {}

    def put(self, kind: str, name: str, entry: Mapping[str, Any]) -> None:
        """Replaces an entry, on disk at once."""
        kinds = self._content.get(kind)
        kept = kinds if isinstance(kinds, dict) else {}
        self._content[kind] = {**kept, name: dict(entry)}
        if self._path.is_symlink():
            self._path.unlink()
        write_json(self._path, self._content)


def fingerprint(*parts: Any) -> str:
    """What tells one set of marks and options from another."""
    return hashlib.sha256(json.dumps(parts, sort_keys=True, default=str).encode()).hexdigest()[:16]


def yaml_content(path: Path) -> dict[str, Any]:
    """A yaml's keys; empty where it is missing or wrong."""
    try:
        found = path.stat()
    except OSError:
        return {}
    return copy.deepcopy(_content(path, found.st_mtime_ns, found.st_size))


@functools.lru_cache(64)
def _content(path: Path, changed_ns: int, size: int) -> dict[str, Any]:
    """Read once for every change: the stages' states are asked for at every click."""
    try:
        return read_mapping(path)
    except InputError:
        return {}

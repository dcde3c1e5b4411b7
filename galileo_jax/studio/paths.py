"""Which files the studio touches: only those below the folder that it was opened on."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from galileo_jax.clip.file_kinds import is_film, is_track
from galileo_jax.runtime.errors import InputError
from galileo_jax.studio.store import yaml_content

NAME = re.compile(r"[\w][\w .()+-]{0,79}", re.UNICODE)


def below(root: Path, *parts: str | Path) -> Path:
    """A path below `root`, links resolved.

    Raises:
      InputError: it leads out of the folder.
    """
    root = root.resolve()
    path = root.joinpath(*parts)
    if not path.resolve().is_relative_to(root):
        raise InputError(f"{path.name}: leads out of {root}; files below it expected")
    return path


def safe_name(name: str) -> str:
    """A file name that stays where it is put.

    Raises:
      InputError: it has parts of a path, starts with a dot, or is no name.
    """
    if not NAME.fullmatch(name) or name.startswith(".") or ".." in name or name != name.strip():
        raise InputError(f"{name[:60]!r}: no file name; letters, digits, - and _ expected")
    return name


def clips(root: Path) -> dict[str, Path]:
    """The clips of a folder by name without suffix: films, and tables that a yaml declares.

    A film goes before a table of its name. Links out of the folder are left out.
    """
    found: dict[str, Path] = {}
    for path in sorted(root.iterdir(), key=lambda path: (not is_film(path), path)):
        is_plain = NAME.fullmatch(path.stem) and not path.name.startswith(".") and path.is_file()
        if is_plain and path.resolve().is_relative_to(root.resolve()) and _is_clip(path):
            found.setdefault(path.stem, path)
    return found


def _is_clip(path: Path) -> bool:
    if not is_track(path):
        return is_film(path)
    return yaml_content(path.with_suffix(".yaml")).get("track") == path.name


def check_declared(root: Path, folder: Path, content: Mapping[str, Any]) -> None:
    """Refuses a yaml that names files outside of the folder.

    Raises:
      InputError: names the key.
    """
    for key in ("video", "track"):
        value = content.get(key)
        if isinstance(value, str) and not (folder / value).resolve().is_relative_to(root.resolve()):
            raise InputError(f"{key}: {value[:60]} leads out of {root}; a file below it expected")

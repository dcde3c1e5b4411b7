"""Texts and documents without what is personal: names of files, of folders, of users, of hosts.

A film's own name may be a person's. What is given to somebody else has `clip1`, `clip2` in its
place, everywhere the same, so that the files still name each other.
"""

import contextlib
import getpass
import re
import shlex
import socket
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import galileo_jax
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import ClipFile, ClipObject
from galileo_jax.model.effects.registry import effect_names

FOLDER = r"(?:[^\s\"'()\[\]<>|:;,=]*[/\\])?"
"""The folders before a file's name, as far as they have no spaces."""
REST = r"[^\s\"'<>|:;,()\[\]]*"
"""Of a path, below a folder that is known."""
PATHS = re.compile(
    r"(?<![\w.:/~])(?:~?/[^\s\"'<>|:;,()\[\]/]+/|[A-Za-z]:[\\/])[^\s\"'<>|:;,()\[\]]*"
)
"""Any absolute path of two parts or more."""
QUOTED = re.compile(r"(?P<mark>[\"'])(?:~?/|[A-Za-z]:[\\/])[^\"'\n]*(?P=mark)")
"""One in quotes, which may have spaces."""
PLAIN = {"root", "user", "clip", "film", "video", "track", "box", "sphere", "cylinder", "torus"}
"""Words that are nobody's, as is a single letter: changed everywhere, they would make nonsense."""


@dataclass(frozen=True)
class Impersonal:
    """What is said in place of what: patterns with replacements, in the order of their use."""

    pairs: tuple[tuple[re.Pattern[str], str], ...]

    def text(self, text: str) -> str:
        """A text without what is personal."""
        for pattern, instead in self.pairs:
            text = pattern.sub(lambda _, instead=instead: instead, text)
        return text

    def value(self, value: Any) -> Any:
        """A JSON document without what is personal, its keys too."""
        if isinstance(value, str):
            return self.text(value)
        if isinstance(value, Mapping):
            return {self.text(str(key)): self.value(one) for key, one in value.items()}
        if isinstance(value, list | tuple):
            return [self.value(one) for one in value]
        return value


def impersonal(
    clips: Sequence[Iterable[Path]], objects: Iterable[str] = (), others: Mapping[str, str] = {}
) -> Impersonal:
    """What is said in place of the names of files, objects, folders, users and hosts.

    Args:
      clips: the files of each clip, as they were named in the call or are named in results.
      objects: names that somebody gave to the objects.
      others: further words, such as folders that the call names, to what is said instead.
    """
    exact = {**others}
    words: dict[str, str] = {}
    for number, files in enumerate(clips, 1):
        for path in files:
            name = f"clip{number}{path.suffix.lower()}"
            exact |= dict.fromkeys((str(path), str(path.resolve())), name)
            exact.setdefault(path.name, name)
            words.setdefault(path.stem, f"clip{number}")
    named = enumerate(objects, 1)
    words |= {name: f"object{n}" for n, name in named if not re.fullmatch(r"object\d+", name)}
    words |= {name: "USER" for name in _users()} | {name: "HOST" for name in _hosts()}
    exact |= {shlex.quote(key): instead for key, instead in exact.items()}
    pairs = [
        (re.compile(rf"(?<!\w){FOLDER}{re.escape(key)}(?!\w)"), exact[key])
        for key in sorted(exact, key=len, reverse=True)
    ]
    pairs += [(re.compile(re.escape(folder)), "") for folder in _own_folders()]
    pairs += [(re.compile(rf"{re.escape(folder)}{REST}"), "PATH") for folder in _places()]
    pairs += [(QUOTED, '"PATH"'), (PATHS, "PATH")]
    kept = _own_words()
    pairs += [
        (re.compile(rf"(?<![^\W_]){re.escape(word)}(?![^\W_])"), words[word])
        for word in sorted(words, key=len, reverse=True)
        if len(word) > 1 and word.lower() not in kept and not re.fullmatch(r"[\d.]*|clip\d+", word)
    ]
    return Impersonal(tuple(pairs))


def _own_words() -> set[str]:
    """What the program itself says in its documents."""
    keys = {*ClipFile.model_fields, *ClipObject.model_fields}
    return {*PLAIN, *SCENARIOS, *effect_names(), *keys}


def _own_folders() -> list[str]:
    """Where the program and its libraries are, the deepest first."""
    package = Path(galileo_jax.__file__).parents[1]
    python = {Path(sys.prefix), Path(sys.base_prefix)}
    libraries = {Path(one) for one in sys.path if python & {*Path(one).parents}}
    return sorted((f"{one}/" for one in (package, *libraries)), key=len, reverse=True)


def _places() -> list[str]:
    """Where the user's files may be, the deepest first."""
    folders = {Path.cwd(), Path.home(), Path(tempfile.gettempdir()), Path(sys.prefix)}
    known = (f"{one}/" for one in folders if len(one.parts) > 1)
    return sorted(known, key=len, reverse=True)


def _users() -> set[str]:
    found = {Path.home().name}
    with contextlib.suppress(OSError, KeyError):  # a container may have no name for its user
        found.add(getpass.getuser())
    return {name for name in found if name}


def _hosts() -> set[str]:
    whole = socket.gethostname()
    return {name for name in (whole, whole.split(".")[0]) if name}

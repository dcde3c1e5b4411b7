"""Entries by name: a file that adds one registers it and touches no other file.

readers: Registry[type[Reader]] = Registry("reader", "readers", "galileo_jax.clip.readers")

@readers.register         decorates a class in any file of that package
readers["tracker"]        imports the package the first time, and looks the name up
"""

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.known_names import did_you_mean

Entry = TypeVar("Entry")
Registered = TypeVar("Registered")


class Registry(Mapping[str, Entry]):
    """Things by their `name`: classes that have one, or instances.

    All modules of `packages`, and a group of installed packages' entry points, register them; they
    are imported when a name is first asked for. `singular` and `plural`: their name in messages.
    """

    def __init__(self, singular: str, plural: str, *packages: str, entry_points: str | None = None):
        self.singular, self.plural = singular, plural
        self._packages = list(packages)
        self._entry_points = entry_points
        self._entries: dict[str, Entry] = {}
        self._is_loaded = False

    def register(self, entry: Registered) -> Registered:
        """Makes an entry known under its `name`, which is to be free; decorates a class."""
        named: Any = entry
        if named.name in self._entries:
            raise InputError(f"two {self.plural} are named {named.name!r}")
        self._entries[named.name] = named
        return entry

    def extend(self, package: str) -> None:
        """Lets another package, or a module, register entries when a name is next asked for."""
        if package not in self._packages:
            self._packages.append(package)
            self._is_loaded = False

    def names(self) -> tuple[str, ...]:
        """All names, sorted."""
        self._load()
        return tuple(sorted(self._entries))

    def __getitem__(self, name: str) -> Entry:
        """The entry of that name; where there is none, an `InputError` lists what there is."""
        self._load()
        if name not in self._entries:
            known = self.names()
            raise InputError(
                f"unknown {self.singular} {name!r}; known: {', '.join(known)}"
                f"{did_you_mean(name, known)}"
            )
        return self._entries[name]

    def __contains__(self, name: object) -> bool:
        return name in self.names()

    def __iter__(self) -> Iterator[str]:
        return iter(self.names())

    def __len__(self) -> int:
        return len(self.names())

    def _load(self) -> None:
        """Imports what registers entries; of two threads that do so, one imports each module."""
        if self._is_loaded:
            return
        for package in list(self._packages):
            found = importlib.import_module(package)
            for module in pkgutil.iter_modules(getattr(found, "__path__", [])):
                importlib.import_module(f"{package}.{module.name}")
        if self._entry_points is not None:
            from importlib import metadata  # only effects have entry points

            for entry in metadata.entry_points(group=self._entry_points):
                try:
                    entry.load()
                except Exception as error:
                    raise InputError(
                        f"{self.plural} of {entry.value} (entry point): {in_words(error)}"
                    ) from error
        self._is_loaded = True


def in_words(error: Exception) -> str:
    """An error in one phrase: what an `InputError` says, others with their type."""
    return str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"


def entry_names(package: str) -> tuple[str, ...]:
    """The names of a package's entries, sorted, where files are named as their entries.

    Nothing is imported, so that the command line knows them without JAX.
    """
    folder = Path(__file__).parents[2].joinpath(*package.split("."))
    return tuple(sorted(module.name for module in pkgutil.iter_modules([str(folder)])))

"""Entries by name: a file that adds one registers it and touches no other file."""

import importlib
import pkgutil
from pathlib import Path
from typing import ClassVar, Generic, Protocol, TypeVar


class Named(Protocol):
    """What a registry holds."""

    name: ClassVar[str]


Base = TypeVar("Base", bound=Named)
Entry = TypeVar("Entry", bound=Named)


class Registry(Generic[Base]):
    """Classes by their `name`.

    Attributes:
      singular: what one entry is called in messages.
      plural: what several are called.
    """

    def __init__(self, base: type[Base], singular: str, plural: str):
        del base  # only tells the type checker what `get` returns
        self.singular, self.plural = singular, plural
        self._entries: dict[str, type[Base]] = {}

    def register(self, entry: type[Entry]) -> type[Entry]:
        """Class decorator: makes the class known under its `name`."""
        if entry.name in self._entries:
            raise ValueError(f"two {self.plural} are named {entry.name!r}")
        self._entries[entry.name] = entry  # pyright: ignore[reportArgumentType]
        return entry

    def names(self) -> tuple[str, ...]:
        """All names, sorted."""
        return tuple(sorted(self._entries))

    def get(self, name: str) -> type[Base]:
        """The class of that name.

        Raises:
          ValueError: nothing is registered under `name`; the message lists what is.
        """
        if name not in self._entries:
            raise ValueError(f"unknown {self.singular} {name!r}; known: {', '.join(self.names())}")
        return self._entries[name]


def load_entries(package: str) -> None:
    """Imports a package's modules, so that each registers its entry."""
    for module in pkgutil.iter_modules(importlib.import_module(package).__path__):
        importlib.import_module(f"{package}.{module.name}")


def entry_names(package: str) -> tuple[str, ...]:
    """The names of a package's entries, sorted, where files are named as their entries.

    Nothing is imported, so that the command line can tell them without JAX.
    """
    folder = Path(__file__).parents[2].joinpath(*package.split("."))
    return tuple(sorted(module.name for module in pkgutil.iter_modules([str(folder)])))

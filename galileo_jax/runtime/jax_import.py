"""JAX imported in two thirds of the time, where a command runs.

While it is imported, `jax._src.numpy.array_constructors` (JAX 0.10) reads the metadata of every
installed package, to find a plugin for AMD's accelerators by its name: a third of the whole import
where 160 packages are installed. The folders say sooner whether there is one.
"""

import sys
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any

SEARCHING = "jax._src.numpy.array_constructors"
PLUGIN = "jax_rocm*plugin*"


def without_search_for_rocm() -> None:
    """Spares JAX, not yet imported, its search through all packages; none where a plugin is."""
    if SEARCHING not in sys.modules and not _has_plugin():
        sys.meta_path.insert(0, _Finder())


def _has_plugin() -> bool:
    return any(next(Path(folder).glob(PLUGIN), None) for folder in sys.path)


class _Finder(MetaPathFinder):
    """Finds one module, once, as it would be found without."""

    def find_spec(self, fullname: str, path: Any, target: Any = None) -> ModuleSpec | None:
        if fullname != SEARCHING:
            return None
        sys.meta_path.remove(self)
        spec = PathFinder.find_spec(fullname, path, target)
        if spec is not None and spec.loader is not None:
            spec.loader = _Loader(spec.loader)
        return spec


class _Loader(Loader):
    """Loads a module for which no packages are installed."""

    def __init__(self, loader: Loader):
        self._loader = loader

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        from importlib import metadata  # not for `galileo --help`

        installed = metadata.distributions
        metadata.distributions = lambda **_: iter(())
        try:
            self._loader.exec_module(module)
        finally:
            metadata.distributions = installed

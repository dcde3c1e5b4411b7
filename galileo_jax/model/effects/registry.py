"""The effects by name: the library's, those of installed packages, those of a user's file.

load_library()                      galileo_jax/effects/library/*.py and entry points
load_file("my_effects.py")          --effects-from
make_effects(["air_drag", ...])     what a `Model` takes
"""

import functools
import importlib
import importlib.metadata
import importlib.util
import pkgutil
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar

from galileo_jax.model.effects.effect import Effect
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.registry import Registry

ENTRY_POINTS = "galileo_jax.effects"
LIBRARY = "galileo_jax.model.effects.library"

effect_registry = Registry(Effect, "effect", "effects")

EffectClass = TypeVar("EffectClass", bound=type[Effect])


def register(effect: EffectClass) -> EffectClass:
    """Class decorator: makes an effect known under its `name`.

    Raises:
      InputError: it is no `Effect`, has no name, or one that is taken.
    """
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise InputError(f"@register: {effect!r} is no subclass of Effect")
    if not isinstance(getattr(effect, "name", None), str):
        raise InputError(f"@register: {effect.__name__} has no name")
    try:
        effect_registry.register(effect)  # pyright: ignore[reportArgumentType]
    except ValueError as error:
        raise InputError(str(error)) from error
    return effect


def load_library() -> None:
    """Registers the library and what installed packages add to it.

    Raises:
      InputError: an installed package's entry point cannot be loaded.
    """
    folder = importlib.import_module(LIBRARY).__path__
    for module in pkgutil.iter_modules(folder):
        importlib.import_module(f"{LIBRARY}.{module.name}")
    for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
        try:
            entry.load()
        except Exception as error:
            raise InputError(f"effects of {entry.value} (entry point): {_said(error)}") from error


def load_file(path: str | Path) -> tuple[str, ...]:
    """Runs a Python file that registers effects; returns their names.

    A file is run once per process, however often it is asked for.

    Raises:
      InputError: there is no such file, it raises, registers no effect, or one whose name is
        taken.
    """
    return _load_resolved(Path(path).resolve())


def effect_names() -> tuple[str, ...]:
    """All names that `make_effects` knows, sorted."""
    load_library()
    return effect_registry.names()


def make_effects(names: Sequence[str]) -> tuple[Effect, ...]:
    """The effects of these names, in the alphabetical order in which their hooks are applied.

    The order of `names` does not matter, so that models with the same effects are the same
    model and share compiled programs.

    Raises:
      InputError: a name is unknown (the message lists the known) or given twice.
    """
    load_library()
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"effects: {name!r} is named twice")
    try:
        return tuple(effect_registry.get(name)() for name in sorted(names))
    except ValueError as error:
        raise InputError(str(error)) from error


@functools.cache
def _load_resolved(path: Path) -> tuple[str, ...]:
    load_library()  # first, so that it is the file whose names are taken
    if not path.is_file():
        raise InputError(f"effects from {path}: no such file")
    before = effect_registry.names()
    spec = importlib.util.spec_from_file_location(f"effects from {path}", path)
    if spec is None or spec.loader is None:
        raise InputError(f"effects from {path}: no Python file (.py)")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        lines = [
            f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == str(path)
        ]
        where = f", line {lines[-1]}" if lines else ""
        raise InputError(f"effects from {path}{where}: {_said(error)}") from error
    added = tuple(name for name in effect_registry.names() if name not in before)
    if not added:
        raise InputError(f"effects from {path}: registers no effect; decorate one with @register")
    return added


def _said(error: Exception) -> str:
    return str(error) if isinstance(error, InputError) else f"{type(error).__name__}: {error}"

"""The effects by name: the library's, those of installed packages, those of a user's file.

make_effects(["air_drag", ...])     what a `Model` takes: of library/*.py and of entry points
load_file("my_effects.py")          --effects-from
"""

import functools
import importlib.util
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import TypeVar, no_type_check

from galileo_jax.model.effects.effect import Effect
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.registry import Registry, in_words

ENTRY_POINTS = "galileo_jax.effects"
LIBRARY = "galileo_jax.model.effects.library"

effect_registry: Registry[type[Effect]] = Registry(
    "effect", "effects", LIBRARY, entry_points=ENTRY_POINTS
)

EffectClass = TypeVar("EffectClass", bound=type[Effect])


@no_type_check  # whatever a user decorates is told in one line
def register(effect: EffectClass) -> EffectClass:
    """Class decorator: makes an effect known under its `name`.

    Raises:
      InputError: it is no `Effect`, has no name, or one that is taken.
    """
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        raise InputError(f"@register: {effect!r} is not a subclass of Effect")
    if not isinstance(getattr(effect, "name", None), str):
        raise InputError(f"@register: {effect.__name__} has no name")
    return effect_registry.register(effect)


def load_file(path: str | Path) -> tuple[str, ...]:
    """Runs a Python file that registers effects; returns their names.

    A file is run once per process, however often it is asked for.

    Raises:
      InputError: there is no such file, it raises, registers no effect, or one whose name is
        taken.
    """
    return _load_resolved(Path(path).resolve())


def effect_names() -> tuple[str, ...]:
    """All names that `make_effects` knows, sorted.

    Raises:
      InputError: an installed package's entry point cannot be loaded.
    """
    return effect_registry.names()


@functools.cache
def library_effects() -> tuple[Effect, ...]:
    """Those of the package itself, in alphabetical order."""
    every = (effect_registry[name] for name in effect_names())
    return tuple(effect() for effect in every if effect.__module__.startswith(f"{LIBRARY}."))


def make_effects(names: Sequence[str]) -> tuple[Effect, ...]:
    """The effects of these names, in the alphabetical order in which their hooks are applied.

    The order of `names` does not matter, so that models with the same effects are the same
    model and share compiled programs.

    Raises:
      InputError: a name is unknown (the message lists the known) or given twice.
    """
    for name in names:
        if names.count(name) > 1:
            raise InputError(f"effects: {name!r} is named twice")
    return tuple(effect_registry[name]() for name in sorted(names))


@functools.cache
def _load_resolved(path: Path) -> tuple[str, ...]:
    before = effect_registry.names()  # loads the library, so that it is the file that is wrong
    if not path.is_file():
        raise InputError(f"effects from {path}: no such file")
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
        raise InputError(f"effects from {path}{where}: {in_words(error)}") from error
    added = tuple(name for name in effect_registry.names() if name not in before)
    if not added:
        raise InputError(f"effects from {path}: registers no effect; decorate one with @register")
    return added

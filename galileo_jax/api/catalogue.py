"""`effects` and `scenarios`: what the package knows, one row each."""

import inspect
import sys
from collections.abc import Sequence
from pathlib import Path

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.model.effects.effect import Effect
from galileo_jax.model.effects.registry import effect_names, load_file, make_effects
from galileo_jax.runtime.lazy import pd


def effects(effects_from: Sequence[str | Path] = ()) -> "pd.DataFrame":
    """The effects that a model can have, by name: `meaning`.

    Args:
      effects_from: Python files that register more.

    Raises:
      InputError: a file is wrong.

    Examples:
      >>> import galileo_jax as gx
      >>> "air_drag" in gx.effects().index
      True
    """
    for path in effects_from:
        load_file(path)
    meanings = {name: _meaning(type(make_effects([name])[0])) for name in effect_names()}
    return pd.DataFrame({"meaning": meanings})


def scenarios() -> "pd.DataFrame":
    """The scenes a clip can show, by name: `meaning`.

    Examples:
      >>> import galileo_jax as gx
      >>> "ramp" in gx.scenarios().index
      True
    """
    meanings = {name: one.meaning for name, one in sorted(SCENARIOS.items())}
    return pd.DataFrame({"meaning": meanings})


def _meaning(effect: type[Effect]) -> str:
    """The first paragraph of its docstring, or of the file that declares it."""
    of_file = getattr(sys.modules.get(effect.__module__), "__doc__", None)
    text = inspect.cleandoc(effect.__doc__ or of_file or "")
    return " ".join(text.split("\n\n")[0].split())

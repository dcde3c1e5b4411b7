"""`effects` and `scenarios`: what the package knows, one row each."""

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd


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
    import pandas as pd

    from galileo_jax.model.effects.registry import effect_names, load_file, make_effects

    for path in effects_from:
        load_file(path)
    rows = {
        name: {"meaning": _first_sentence(type(make_effects([name])[0]))} for name in effect_names()
    }
    return pd.DataFrame.from_dict(rows, orient="index")


def scenarios() -> "pd.DataFrame":
    """The scenes a clip can show, by name: `meaning`.

    Examples:
      >>> import galileo_jax as gx
      >>> "ramp" in gx.scenarios().index
      True
    """
    import pandas as pd

    from galileo_jax.clip.scenarios import SCENARIOS

    rows = {name: {"meaning": one.meaning} for name, one in sorted(SCENARIOS.items())}
    return pd.DataFrame.from_dict(rows, orient="index")


def _first_sentence(kind: type) -> str:
    text = inspect.getdoc(kind) or ""
    return " ".join(text.split("\n\n")[0].split())

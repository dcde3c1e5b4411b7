"""The truth beside a synthetic clip, shown next to what was found and used for nothing else."""

import json
from typing import TYPE_CHECKING, Any

from galileo_jax.inference.mass_ratios import mass_ratios
from galileo_jax.runtime.errors import InputError

if TYPE_CHECKING:
    from galileo_jax.clip.schema import Clip


def true_parameters(clip: "Clip") -> dict[str, float]:
    """What NAME.truth.json beside a synthetic clip says of its parameters; {} without.

    Raises:
      InputError: the file is there and is not what `galileo simulate` writes.
    """
    content = _content(clip)
    if content is None:
        return {}
    path = clip.path.with_suffix(".truth.json")
    try:
        if "parameters" in content:
            return {key: float(value) for key, value in content["parameters"].items()}
        count = content.get("objects", 2)
        names = [f"{key}{i + 1}" for i in range(count) for key in "mk"]
        known = {name: float(content[name]) for name in names}
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: not a truth with m1, k1, m2 and k2 ({error})") from error
    return known | mass_ratios([known[f"m{i + 1}"] for i in range(count)])


def hidden_effect(clip: "Clip") -> str | None:
    """What NAME.truth.json beside a synthetic clip says was hidden in it; None without.

    Raises:
      InputError: the file is there and names no effect.
    """
    content = _content(clip)
    if content is None:
        return None
    try:
        return str(content["effect"])
    except (KeyError, TypeError) as error:
        path = clip.path.with_suffix(".truth.json")
        raise InputError(f"{path}: not a truth with an effect ({error})") from error


def _content(clip: "Clip") -> Any:
    path = clip.path.with_suffix(".truth.json")
    if not path.is_file():
        return None
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error})") from error

"""The truth beside a synthetic clip, shown next to what was found and used for nothing else."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from galileo_jax.inference.mass_ratios import mass_ratios
from galileo_jax.runtime.errors import InputError

Told = TypeVar("Told")


def true_parameters(clip: Path) -> dict[str, float]:
    """What NAME.truth.json beside a synthetic clip says of its parameters; {} without."""
    return _told(clip, "m1, k1, m2 and k2", _parameters) or {}


def hidden_effect(clip: Path) -> str | None:
    """What NAME.truth.json beside a synthetic clip says was hidden in it; None without."""
    return _told(clip, "an effect", lambda content: str(content["effect"]))


def _parameters(content: Any) -> dict[str, float]:
    if "parameters" in content:
        return {key: float(value) for key, value in content["parameters"].items()}
    numbers = range(1, content.get("objects", 2) + 1)
    known = {f"{key}{n}": float(content[f"{key}{n}"]) for n in numbers for key in "mk"}
    return known | mass_ratios([known[f"m{n}"] for n in numbers])


def _told(clip: Path, what: str, read: Callable[[Any], Told]) -> Told | None:
    path = clip.with_suffix(".truth.json")
    if not path.is_file():
        return None
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise InputError(f"{path}: not JSON ({error})") from error
    try:
        return read(content)
    except (ValueError, KeyError, TypeError, AttributeError, ZeroDivisionError) as error:
        raise InputError(
            f"{path}: not a truth with {what} ({error}), as galileo simulate writes it; "
            "a file of your own needs another name"
        ) from error

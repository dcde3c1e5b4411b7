"""How every benchmark here reports: rows of a table, then one line of JSON."""

import json
import math
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from typing import Any

import numpy as np

PACKAGES = ("jax", "mujoco", "mujoco-mjx", "numpy")
WIDTH = 11


def row(first: str, values: Sequence[Any]) -> None:
    """Prints one row at once, so that a long benchmark shows how far it is."""
    print(f"{first:<28}" + "".join(f" {_cell(v):>{WIDTH - 1}}" for v in values), flush=True)


def finish(name: str, figures: Mapping[str, Any]) -> None:
    """Prints the JSON line: the figures, the machine and the versions."""
    machine = {
        "cores": os.cpu_count(),
        "load": round(os.getloadavg()[0], 1),
        "python": platform.python_version(),
        **{package: version(package) for package in PACKAGES},
    }
    print(json.dumps({"benchmark": name, **_plain(figures), "machine": machine}))


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "NO"
    if isinstance(value, float | np.floating):
        return "-" if math.isnan(value) else f"{value:.4g}"
    return str(value)


def _plain(value: Any) -> Any:
    """The value with four significant digits, and null where there is no number."""
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(entry) for entry in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.4g}") if math.isfinite(value) else None
    return int(value) if isinstance(value, np.integer) else value


def mean(values: Iterable[float]) -> float:
    """The mean of what is known; NaN where nothing is."""
    known = [value for value in values if not math.isnan(value)]
    return float(np.mean(known)) if known else math.nan


def summary(figures: Mapping[str, Any]) -> None:
    """Prints every figure that is a single number, a row each."""
    for name, value in figures.items():
        if isinstance(value, int | float):
            row(name, [value])


def by_name(title: str, rows: Mapping[str, Mapping[str, Any]]) -> None:
    """Prints a row for each name, and above them what their figures are called."""
    row(title, [*next(iter(rows.values()))])
    for name, figures in rows.items():
        row(name, list(figures.values()))


def missed(bars: Iterable[str]) -> list[str]:
    """Prints the bars that were missed, and returns them."""
    found = list(bars)
    print("bars missed: " + ("; ".join(found) or "none"))
    return found

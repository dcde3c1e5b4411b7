"""Numbers as text with the digits that they bear, and no more.

A digit is shown if it is worth more than the Monte Carlo error, and not beyond the second figure of
the standard deviation; its first figure is always shown, for an interval has two ends. Mean,
standard deviation and interval end at the same place: that of the least certain, an end of the
interval.
"""

import math
from collections.abc import Mapping
from typing import Any


def number(value: float | None, sd: float | None, error: float = 0.0) -> str:
    """A value with as many places as two figures of its uncertainty allow.

    Args:
      value: None or not finite: "n/a".
      sd: its uncertainty; 0 or None: four figures are shown.
      error: what its last digit must be worth at least, in the unit of the value.
    """
    if value is None or not math.isfinite(value):
        return "n/a"
    if not sd or not math.isfinite(sd):
        return f"{value:.4g}"
    first = -math.floor(math.log10(sd))
    places = first + 1
    if error > 0:
        places = max(first, min(places, -math.ceil(math.log10(error))))
    return f"{round(value, min(places, 9)):z.{min(max(places, 0), 9)}f}"  # z: never -0.00


def shown(entry: Mapping[str, Any], key: str = "mean") -> str:
    """A number of a parameter's entry in result.json, as text; all four to the same place.

    Args:
      entry: with `sd` and, if it was written since there is one, `mcse`.
      key: "mean", "sd", "q025" or "q975".
    """
    return number(entry[key], entry["sd"], max(entry.get("mcse", {"": 0.0}).values()))


def interval_text(entry: Mapping[str, Any]) -> str:
    """The ends of the 95 % interval."""
    return f"{shown(entry, 'q025')} to {shown(entry, 'q975')}"


def unit_text(entry: Mapping[str, Any]) -> str:
    """The unit after a blank; empty of a pure number."""
    return "" if entry["unit"] == "1" else f" {entry['unit']}"


def value_text(entry: Mapping[str, Any], sign: str = "±") -> str:
    """Mean, standard deviation and unit."""
    return f"{shown(entry)} {sign} {shown(entry, 'sd')}{unit_text(entry)}"

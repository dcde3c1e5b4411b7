"""Which of a fit's numbers are shown, and with which digits: those that they bear, and no more.

A digit is shown if it is worth more than the Monte Carlo error, and not beyond the second figure of
the standard deviation; its first figure is always shown, for an interval has two ends. Mean,
standard deviation and interval end at the same place: that of the least certain, an end of the
interval.
"""

import math
import re
from collections.abc import Mapping
from typing import Any

from galileo_jax.inference.per_mass import per_mass_unit

DECLARED_WIDTH = 0.02  # of a number: no prior that was not declared is so narrow
MASS = re.compile(r"m\d+")
HEADLINES = re.compile(r"gravity|k\d+|mass_ratio(_\d+_\d+)?")


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

    `key`: "mean", "sd", "q025" or "q975". Entries of earlier versions have no `mcse`.
    """
    return number(entry[key], entry["sd"], max(entry.get("mcse", {"": 0.0}).values()))


def interval_text(entry: Mapping[str, Any]) -> str:
    """The ends of the 95 % interval."""
    return f"{shown(entry, 'q025')} to {shown(entry, 'q975')}"


def is_as_declared(entry: Mapping[str, Any]) -> bool:
    """Whether the clip tells nothing of a number that is known all the same, as a mass weighed."""
    width = entry["q975"] - entry["q025"]
    return not entry["identified"] and width < DECLARED_WIDTH * abs(entry["mean"])


def unit_text(entry: Mapping[str, Any]) -> str:
    """The unit after a blank; empty of a pure number."""
    return "" if entry["unit"] == "1" else f" {entry['unit']}"


def value_text(entry: Mapping[str, Any], sign: str = "±") -> str:
    """Mean, standard deviation and unit."""
    return f"{shown(entry)} {sign} {shown(entry, 'sd')}{unit_text(entry)}"


def shown_parameters(result: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Entries of parameters and what is derived from them, without a mass that acts on nothing.

    The mass of a single object cancels out of its motion unless something in the model is a
    force or a force's constant (its unit has a kg or N in it). result.json keeps it all the same.
    """
    entries = {**result["parameters"], **result.get("derived", {})}
    masses = [name for name in entries if MASS.fullmatch(name)]
    units = [entry["unit"] for name, entry in entries.items() if name not in masses]
    if len(masses) == 1 and not any(per_mass_unit(unit) for unit in units):
        del entries[masses[0]]
    return entries


def headlines(entries: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Frictions, ratios of masses and g; of a motion that has none of them what it determines.

    In the alphabet of their names, ratios last.
    """
    found = sorted(filter(HEADLINES.fullmatch, entries), key=lambda name: ("mass" in name, name))
    no_mass = (name for name in entries if not MASS.fullmatch(name) and name != "phi")
    shown = found or [name for name in no_mass if entries[name]["identified"]]
    return {name: entries[name] for name in shown}


def point_estimate(result: Mapping[str, Any]) -> dict[str, float]:
    """The estimate of a method whose draws are no posterior, by name; else empty."""
    best = dict(result.get("best") or {})
    return best | {"mass_ratio": best["m1"] / best["m2"]} if {"m1", "m2"} <= set(best) else best

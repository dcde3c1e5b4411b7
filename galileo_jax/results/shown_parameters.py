"""Which of a fit's parameters are shown: those that have a meaning for the motion."""

import re
from collections.abc import Mapping
from typing import Any

from galileo_jax.inference.per_mass import per_mass_unit

MASS = re.compile(r"m\d+")
HEADLINES = re.compile(r"gravity|k\d+|mass_ratio(_\d+_\d+)?")


def shown_parameters(result: Mapping[str, Any]) -> dict[str, Mapping[str, Any]]:
    """Entries of parameters and what is derived from them, without a mass that acts on nothing.

    The mass of a single object cancels out of its motion unless something in the model is a
    force or a force's constant (its unit has a kg or N in it). result.json keeps it all the same.

    Returns:
      entries by name, in the order of result.json.
    """
    entries = {**result["parameters"], **result.get("derived", {})}
    masses = [name for name in entries if MASS.fullmatch(name)]
    units = [entry["unit"] for name, entry in entries.items() if name not in masses]
    if len(masses) == 1 and not any(per_mass_unit(unit) for unit in units):
        del entries[masses[0]]
    return entries


def headlines(entries: Mapping[str, Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Frictions, ratios of masses and g; of a motion that has none of them what it determines.

    Returns:
      entries by name: those of `HEADLINES` in their alphabet, ratios last.
    """
    found = sorted(filter(HEADLINES.fullmatch, entries), key=lambda name: ("mass" in name, name))
    no_mass = (name for name in entries if not MASS.fullmatch(name) and name != "phi")
    shown = found or [name for name in no_mass if entries[name]["identified"]]
    return {name: entries[name] for name in shown}


def point_estimate(result: Mapping[str, Any]) -> dict[str, float]:
    """The estimate of a method whose draws are no posterior, by name; else empty."""
    best = dict(result.get("best") or {})
    return best | {"mass_ratio": best["m1"] / best["m2"]} if {"m1", "m2"} <= set(best) else best

"""Ratios of masses: all that collisions tell of them."""

from collections.abc import Sequence
from itertools import pairwise
from typing import Any


def mass_ratios(masses_kg: Sequence[Any]) -> dict[str, Any]:
    """By name, for the objects' masses in order, each a number or an array of draws.

    mass_ratio is m1 / m2 and phi (m1 - m2) / (m1 + m2); further neighbours' ratios are called
    mass_ratio_2_3 and so on. Empty for one object.
    """
    if len(masses_kg) < 2:
        return {}
    m1, m2 = masses_kg[:2]
    found = {"mass_ratio": m1 / m2, "phi": (m1 - m2) / (m1 + m2)}
    further = enumerate(pairwise(masses_kg[1:]), 2)
    return found | {f"mass_ratio_{i}_{i + 1}": one / other for i, (one, other) in further}

"""How large declared objects are along and across their way, and which of them roll."""

import math
from collections.abc import Sequence
from typing import Any

from galileo_jax.clip.schema import ClipObject

# Where nothing else is declared; an incline's dynamics do not depend on it.
UNKNOWN_BOX_M: tuple[float, ...] = (0.04, 0.04, 0.04)
UNKNOWN_ROUND_M: tuple[float, ...] = (0.02, 0.01)


def half_sides(shape: str, size_m: Sequence[float]) -> tuple[float, float]:
    """Half the length and half the height of a shape, m: a cylinder stands, a torus lies flat."""
    match shape:
        case "box":
            return size_m[0] / 2, size_m[2] / 2
        case "cylinder":
            return size_m[0], size_m[1] / 2
        case "torus":
            return size_m[0] + size_m[1], size_m[1]
        case _:
            return size_m[0], size_m[0]


def extents(declared: ClipObject) -> tuple[float, float]:
    """Half the length along the travel and half the height of an object, m.

    What slides does so as in `half_sides`; where they roll, a cylinder lies across the travel and a
    torus stands on edge.
    """
    unknown = UNKNOWN_BOX_M if declared.shape == "box" else UNKNOWN_ROUND_M
    length, height = half_sides(declared.shape, declared.size_m or unknown)
    return length, height if declared.roll_inertia is None else length


def rolling(objects: Sequence[ClipObject]) -> dict[str, Any]:
    """Which objects roll and their inertias, as `Surroundings` takes them; {} where none does."""
    shares = [declared.roll_inertia for declared in objects]
    if not any(shares):
        return {}
    rolls = tuple(share is not None for share in shares)
    return {"rolls": rolls, "roll_inertia": tuple(share or 0.0 for share in shares)}


def volume_m3(declared: ClipObject) -> float | None:
    """Of an object; None where its size is not known."""
    size = declared.size_m
    if size is None:
        return None
    match declared.shape:
        case "box":
            return math.prod(size)
        case "cylinder":
            return math.pi * size[0] ** 2 * size[1]
        case "torus":
            return 2 * math.pi**2 * size[0] * size[1] ** 2
        case "sphere":
            return 4 / 3 * math.pi * size[0] ** 3

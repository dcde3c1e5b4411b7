"""How large declared objects are along and across their way, and which of them roll."""

import math
from collections.abc import Sequence
from typing import Any

from galileo_jax.clip.schema import ClipObject

# Where nothing else is declared; an incline's dynamics do not depend on it.
UNKNOWN_BOX_M: tuple[float, ...] = (0.04, 0.04, 0.04)
UNKNOWN_ROUND_M: tuple[float, ...] = (0.02, 0.01)


def extents(declared: ClipObject) -> tuple[float, float]:
    """Half the length along the travel and half the height of an object, m.

    A cylinder stands upright, a torus lies flat, and they slide on their base; where they roll,
    the cylinder lies across the travel and the torus stands on edge.
    """
    unknown = UNKNOWN_BOX_M if declared.shape == "box" else UNKNOWN_ROUND_M
    size = declared.size_m or unknown
    if declared.roll_inertia is not None:
        radius = size[0] + (size[1] if declared.shape == "torus" else 0.0)
        return radius, radius
    match declared.shape:
        case "box":
            return size[0] / 2, size[2] / 2
        case "cylinder":
            return size[0], size[1] / 2
        case "torus":
            return size[0] + size[1], size[1]
        case _:
            return size[0], size[0]


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

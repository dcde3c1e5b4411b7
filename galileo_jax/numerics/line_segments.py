"""Distances of points of a plane from straight lines with two ends, such as a wall's."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.numerics.runs import stretches

NEAR = 1.15  # of a radius: so near is what bounces off a line in some frame


def distance_to_segment(
    places_m: np.ndarray, ends_m: Sequence[Sequence[float]]
) -> Float[np.ndarray, "..."]:
    """Distance of points `[..., 2]` from the line between two ends, m."""
    start, along = np.asarray(ends_m[0], float), np.subtract(ends_m[1], ends_m[0])
    share = np.clip((places_m - start) @ along / (along @ along), 0.0, 1.0)
    return np.linalg.norm(places_m - start - share[..., None] * along, axis=-1)


def nearest_frames(
    place_m: Float[np.ndarray, "2 frame"],
    is_seen: Bool[np.ndarray, " frame"],
    ends_m: Sequence[Sequence[float]],
    radius_m: float,
) -> list[int]:
    """The frames in which a disc is nearest to a line, one for each stay beside it."""
    away = distance_to_segment(np.moveaxis(np.nan_to_num(place_m), 0, -1), ends_m)
    away = np.where(is_seen, away, np.inf)
    return [near.start + int(np.argmin(away[near])) for near in stretches(away < NEAR * radius_m)]

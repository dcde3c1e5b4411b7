"""Poses of one body: where its centre is and how it is turned, frame by frame."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Poses:
    """A body's measured poses; x and y level, z up."""

    name: str  # of the clip
    times_s: Float[np.ndarray, " frame"]  # `[frame]`, s, increasing
    position_m: Float[np.ndarray, "frame 3"]  # `[frame, 3]`, its centre, m
    # `[frame, 4]`, of length 1, real part first; from the body's axes to the world's
    quaternion: Float[np.ndarray, "frame 4"]

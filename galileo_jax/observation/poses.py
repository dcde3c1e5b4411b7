"""Poses of one body: where its centre is and how it is turned, frame by frame."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Poses:
    """A body's measured poses; x and y level, z up.

    Attributes:
      name: of the clip.
      times_s: `[frame]`, s, increasing.
      position_m: `[frame, 3]`, its centre, m.
      quaternion: `[frame, 4]`, of length 1, real part first; from the body's axes to the world's.
    """

    name: str
    times_s: Float[np.ndarray, " frame"]
    position_m: Float[np.ndarray, "frame 3"]
    quaternion: Float[np.ndarray, "frame 4"]

"""What is declared about a clip: wrong where an effect of the measurement is hidden."""

import math
from dataclasses import dataclass

import numpy as np

from galileo_jax.simulation.truth import Truth


@dataclass(frozen=True)
class Declared:
    """What a user says of a clip: wrong where an effect of the measurement is hidden.

    Attributes:
      fps: frames per second.
      ramp_angle_deg: of the ramp.
      scale: measured lengths are so many times the true ones.
      true_fps: at which the frames were taken.
      release_s: when object 1 is let go after the first frame, true seconds.
    """

    fps: float
    ramp_angle_deg: float
    scale: float
    true_fps: float
    release_s: float

    @classmethod
    def of(cls, truth: Truth, fps: float) -> "Declared":
        """What is declared about `truth`, filmed at what is said to be `fps`."""
        value = truth.effect_values.get
        steeper_deg = math.degrees(value("ramp_angle", 0.0))
        return cls(
            fps=fps,
            ramp_angle_deg=round(truth.ramp_angle_deg - steeper_deg, 9),
            scale=1.0 + value("scale_error", 0.0),
            true_fps=fps / (1.0 + value("frame_rate", 0.0)),
            release_s=value("release_delay", 0.0) + value("release_instant", 0.0),
        )

    def taken_s(self, num_frames: int) -> np.ndarray:
        """When each frame was taken, `[frame]`, true seconds since the release."""
        return np.arange(num_frames) / self.true_fps - self.release_s

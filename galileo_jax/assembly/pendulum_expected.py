"""Where a pendulum's priors are centred: its length, its angle and its speed at the start."""

import math

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.model.effects.laws.pendulum import ANGLE, LENGTH
from galileo_jax.numerics.least_squares import circle
from galileo_jax.numerics.periodogram import period_s

LENGTH_SD, ANGLE_SD_RAD = 0.3, 0.15  # of its logarithm; of what the path tells
SPEED_SD = 0.3  # of the speed of a fall through the length
TAPE_M, PLACE_M = 0.002, 0.01  # how well a thread, and a pivot in the picture, are measured
WIDE_RAD = 0.3  # of a path whose circle shows where the pivot is


def pendulum_expected(
    clip: Clip, times_s: np.ndarray, place_m: np.ndarray, velocity: tuple[float, ...]
) -> dict[str, tuple[float, float]]:
    """The two numbers of each prior, by name.

    The period tells the length in metres, whatever the scale; the circle that the path is on the
    angle, or where it is too short for that its middle.

    Args:
      clip: what is declared.
      times_s: `[frame]`, of frames in which the bob is seen.
      place_m: `[axis, frame]`, as measured.
      velocity: in the first of them, m/s.
    """
    x, y = place_m[0], place_m[1]
    length = clip.gravity * (period_s(times_s, x) / (2 * math.pi)) ** 2
    length_sd = LENGTH_SD
    centre, radius = circle(x, y)
    angles = np.arctan2(x - centre[0], centre[1] - y)
    angle, angle_sd = float(angles[0]), ANGLE_SD_RAD
    if np.ptp(angles) < WIDE_RAD or not math.isfinite(radius):
        middle = 0.5 * (float(x.min()) + float(x.max()))
        radius = length if clip.is_scale_known else max(10 * float(np.ptp(x)), 1e-3)
        angle = math.asin(min(max((float(x[0]) - middle) / radius, -1.0), 1.0))
    if clip.pivot_m is not None and clip.is_scale_known:
        aside, above = x[0] - clip.pivot_m[0], clip.pivot_m[1] - y[0]
        length = radius = float(np.hypot(aside, above))
        angle, angle_sd = float(np.arctan2(aside, above)), PLACE_M / radius
        length_sd = PLACE_M / length
    if clip.thread_m is not None:
        length, length_sd = clip.thread_m, TAPE_M / clip.thread_m
    along = velocity[0] * math.cos(angle) + velocity[1] * math.sin(angle)
    fall = math.sqrt(2 * clip.gravity * length)
    return {
        LENGTH: (length, length_sd),
        ANGLE: (angle, angle_sd),
        "start_speed": (along * length / radius, SPEED_SD * fall),
    }

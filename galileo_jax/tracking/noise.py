"""The honest covariance of a tracked point: image noise, sampling, and blows in an exposure."""

import numpy as np

MIN_FRAMES = 8
"""Fewer moving frames do not tell the scatter."""
MIN_STEP_PX = 0.5
"""Slower than this per frame, the errors of sampling hardly change from frame to frame."""
THIRD_DIFFERENCE_VARIANCE = 20.0
"""1 + 9 + 9 + 1: the variance of a third difference of independent errors of variance one."""
CHI2_MEDIAN = 0.4549
"""Median of chi^2 with one degree of freedom."""
LEAST_SD_PX = 0.005
"""The alignment's own error in pictures without noise, per axis. Measured on drawn boxes at
random places within a pixel: 0.0034 px from frame to frame, and 0.010 px in common to all
frames, which only shifts the path and is not counted in full."""


def scatter_variance(poses: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """`[frame]`, variance per axis of the scatter beyond the stated `covariance` while moving.

    Image noise is in `covariance` already, but the smear and the sampling of the object's
    texture by the pixels make errors, too, that change with the place within a pixel. Third
    differences of the positions remove any smooth motion; their median is not touched by
    single blows. 0 where the object stands still, if the scatter is explained, or if it moves
    in too few frames to tell.

    Args:
      poses: `[frame, 3]`, NaN where not visible.
      covariance: `[frame, 2, 2]`, px^2.
    """
    place = poses[:, :2]
    third = np.diff(place, n=3, axis=0)
    steps = np.linalg.norm(np.diff(place, axis=0), axis=1)
    # A NaN step compares False: runs with gaps do not count.
    is_moving = np.lib.stride_tricks.sliding_window_view(steps, 3).min(axis=1) > MIN_STEP_PX
    if is_moving.sum() < MIN_FRAMES:
        return np.zeros(len(poses))
    stated = np.trace(covariance, axis1=1, axis2=2) / 2
    stated = np.lib.stride_tricks.sliding_window_view(stated, 4).mean(axis=1)
    total = np.median(third[is_moving] ** 2) / (CHI2_MEDIAN * THIRD_DIFFERENCE_VARIANCE)
    excess = max(0.0, float(total - np.median(stated[is_moving])))
    still = np.isfinite(steps) & (steps <= MIN_STEP_PX)
    is_still = np.append(still, still[-1:]) & np.append(still[:1], still)
    return np.where(is_still, 0.0, excess)


def blow_covariance(jumps: np.ndarray, exposure_share: float) -> np.ndarray:
    """The `[frame, 2, 2]` variance from a blow that falls within an exposure.

    A picture shows the mean place during the exposure e. If the velocity jumps by dv at its
    middle, that is dv e / 8 off the place at its middle; the sign and the instant are not
    known. Only what exceeds the steady acceleration around it is a blow.

    Args:
      jumps: `[frame, 3]`, change of the pose's velocity at each frame, per frame.
      exposure_share: open share of a frame's time.
    """
    padded = np.pad(jumps[:, :2], ((2, 2), (0, 0)), mode="edge")
    steady = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0), axis=-1)
    offset = (jumps[:, :2] - steady) * exposure_share / 8
    return offset[:, :, None] * offset[:, None, :]

"""The rigid motion of a set of points, robust against those that went astray."""

import numpy as np

from galileo_jax.tracking.pose import rotation

MIN_POINTS = 3
INLIER_PX = 2.0


def rigid_motion(before: np.ndarray, after: np.ndarray) -> tuple[float, np.ndarray] | None:
    """Angle and shift with `after ~ R(angle) before + shift`, over the points that agree.

    Starts from the median shift and then alternates least squares (Kabsch 1976,
    doi:10.1107/S0567739476001873) with dropping points farther than `INLIER_PX` or three
    times the median residual. `before` and `after` are `[point, 2]`. None with fewer than
    three points in agreement.
    """
    if len(before) < MIN_POINTS:
        return None
    angle, shift = 0.0, np.median(after - before, axis=0)
    agreed: np.ndarray | None = None
    for _ in range(5):
        residual = np.linalg.norm(before @ rotation(angle).T + shift - after, axis=1)
        is_inlier = residual <= max(INLIER_PX, 3 * float(np.median(residual)))
        if agreed is not None and (is_inlier == agreed).all():
            break
        agreed = is_inlier
        if is_inlier.sum() < MIN_POINTS:
            return None
        a, b = before[is_inlier], after[is_inlier]
        a0, b0 = a - a.mean(axis=0), b - b.mean(axis=0)
        angle = float(
            np.arctan2((a0[:, 0] * b0[:, 1] - a0[:, 1] * b0[:, 0]).sum(), (a0 * b0).sum())
        )
        shift = b.mean(axis=0) - rotation(angle) @ a.mean(axis=0)
    return angle, shift

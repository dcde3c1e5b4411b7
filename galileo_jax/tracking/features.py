"""Shi-Tomasi features on an object, followed to the next frame by pyramidal Lucas-Kanade.

Sources: J. Shi, C. Tomasi, "Good Features to Track", CVPR 1994, doi:10.1109/CVPR.1994.323794;
J.-Y. Bouguet, "Pyramidal Implementation of the Lucas Kanade Feature Tracker" (2001).
"""

import cv2
import numpy as np

from galileo_jax.tracking.pose import rotation

MAX_FEATURES = 40
FORWARD_BACKWARD_PX = 0.5
"""A feature counts if tracking it there and back returns this close to where it began."""
PYRAMID_LEVELS = 3
LEAST_WINDOW_PX = 16
MIN_POINTS, INLIER_PX = 3, 2.0  # of a rigid motion


def follow(
    before: np.ndarray, after: np.ndarray, pose: np.ndarray, region: np.ndarray, reach_px: int
) -> tuple[np.ndarray, np.ndarray]:
    """Follows the features of the object at `pose` from one grey frame to the next.

    `region` is the object's patch `[size, size]` (bool), `reach_px` the largest displacement.
    Returns the features' places before and after, both `[feature, 2]` in pixels; only those
    that pass the forward-backward check, so possibly none.
    """
    none = np.empty((0, 2)), np.empty((0, 2))
    radius = (region.shape[0] - 1) // 2
    margin = int(1.5 * radius) + reach_px
    low = np.maximum(pose[:2].astype(int) - margin, 0)
    high = np.minimum(pose[:2].astype(int) + margin, before.shape[::-1])
    if (high - low).min() < LEAST_WINDOW_PX:
        return none
    window = np.s_[low[1] : high[1], low[0] : high[0]]
    first, second = before[window], after[window]
    turn = rotation(pose[2])
    shift = pose[:2] - low - turn @ (radius, radius)
    mask = cv2.warpAffine(
        region.astype(np.uint8) * 255, np.column_stack([turn, shift]), first.shape[::-1]
    )
    features = cv2.goodFeaturesToTrack(first, MAX_FEATURES, 0.05, 3, mask=mask)
    if features is None:
        return none
    features = features.reshape(-1, 2)
    window_px = int(np.clip(radius, 7, 21))
    moved, is_good = follow_points(first, second, features, window_px, PYRAMID_LEVELS)
    return features[is_good] + low, moved[is_good] + low


def follow_points(
    before: np.ndarray, after: np.ndarray, points: np.ndarray, window_px: int, levels: int
) -> tuple[np.ndarray, np.ndarray]:
    """Where `points` `[point, 2]` go from one grey frame to the next, and `[point]`: which count.

    `levels` is the number of pyramid levels above the picture itself.
    """

    def flow(one: np.ndarray, other: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        size = (window_px, window_px)
        there, is_found, _ = cv2.calcOpticalFlowPyrLK(
            one, other, at, at.copy(), winSize=size, maxLevel=levels
        )
        return there, is_found.ravel() > 0

    start = points.astype(np.float32).reshape(-1, 1, 2)
    moved, is_found = flow(before, after, start)
    back, is_back = flow(after, before, moved)
    error = np.linalg.norm((back - start).reshape(-1, 2), axis=1)
    return moved.reshape(-1, 2), is_found & is_back & (error < FORWARD_BACKWARD_PX)


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
    agreed = np.zeros(len(before), bool)
    for _ in range(5):
        residual = np.linalg.norm(before @ rotation(angle).T + shift - after, axis=1)
        is_inlier = residual <= max(INLIER_PX, 3 * float(np.median(residual)))
        if (is_inlier == agreed).all():
            break
        agreed = is_inlier
        if is_inlier.sum() < MIN_POINTS:
            return None
        a, b = before[is_inlier], after[is_inlier]
        (ax, ay), (bx, by) = (a - a.mean(axis=0)).T, (b - b.mean(axis=0)).T
        angle = float(np.arctan2(np.sum(ax * by - ay * bx), np.sum(ax * bx + ay * by)))
        shift = b.mean(axis=0) - rotation(angle) @ a.mean(axis=0)
    return angle, shift

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


def follow(
    before: np.ndarray, after: np.ndarray, pose: np.ndarray, region: np.ndarray, reach_px: int
) -> tuple[np.ndarray, np.ndarray]:
    """Follows the features of the object at `pose` from one grey frame to the next.

    `region` is the object's patch `[size, size]` (bool), `reach_px` the largest displacement.
    Returns the features' places before and after, both `[feature, 2]` in pixels; only those
    that pass the forward-backward check, so possibly none.
    """
    radius = (region.shape[0] - 1) // 2
    margin = int(1.5 * radius) + reach_px
    low = np.maximum(pose[:2].astype(int) - margin, 0)
    high = np.minimum(pose[:2].astype(int) + margin, before.shape[::-1])
    if (high - low).min() < LEAST_WINDOW_PX:
        return np.empty((0, 2)), np.empty((0, 2))
    window = np.s_[low[1] : high[1], low[0] : high[0]]
    first, second = before[window], after[window]
    turn = rotation(pose[2])
    shift = pose[:2] - low - turn @ (radius, radius)
    mask = cv2.warpAffine(
        region.astype(np.uint8) * 255, np.column_stack([turn, shift]), first.shape[::-1]
    )
    features = cv2.goodFeaturesToTrack(first, MAX_FEATURES, 0.05, 3, mask=mask)
    if features is None:
        return np.empty((0, 2)), np.empty((0, 2))
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
    start = points.astype(np.float32).reshape(-1, 1, 2)
    size = (window_px, window_px)
    moved, is_found, _ = cv2.calcOpticalFlowPyrLK(
        before, after, start, start.copy(), winSize=size, maxLevel=levels
    )
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(
        after, before, moved, moved.copy(), winSize=size, maxLevel=levels
    )
    error = np.linalg.norm((back - start).reshape(-1, 2), axis=1)
    is_good = (is_found.ravel() > 0) & (is_back.ravel() > 0) & (error < FORWARD_BACKWARD_PX)
    return moved.reshape(-1, 2), is_good

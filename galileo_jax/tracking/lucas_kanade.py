"""Shi-Tomasi features on an object, followed to the next frame by pyramidal Lucas-Kanade.

Sources: J. Shi, C. Tomasi, "Good Features to Track", CVPR 1994, doi:10.1109/CVPR.1994.323794;
J.-Y. Bouguet, "Pyramidal Implementation of the Lucas Kanade Feature Tracker" (2001).
"""

import cv2
import numpy as np

MAX_FEATURES = 40
FORWARD_BACKWARD_PX = 0.5
"""A feature counts if tracking it there and back returns this close to where it began."""


def follow(
    before: np.ndarray, after: np.ndarray, pose: np.ndarray, region: np.ndarray, reach_px: int
) -> tuple[np.ndarray, np.ndarray]:
    """Follows the features of the object at `pose` from one grey frame to the next.

    `region` is the object's patch `[size, size]` (bool), `reach_px` the largest displacement.
    Returns the features' places before and after, both `[feature, 2]` in pixels; only those
    that pass the forward-backward check, so possibly none.
    """
    height, width = before.shape
    radius = (region.shape[0] - 1) // 2
    margin = int(1.5 * radius) + reach_px
    left, top = (int(np.clip(c - margin, 0, n - 1)) for c, n in zip(pose, (width, height)))
    right, bottom = (int(np.clip(c + margin, 1, n)) for c, n in zip(pose, (width, height)))
    if right - left < 16 or bottom - top < 16:
        return np.empty((0, 2)), np.empty((0, 2))
    window = np.s_[top:bottom, left:right]
    first, second = before[window], after[window]
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s], [s, c]])
    shift = pose[:2] - (left, top) - turn @ (radius, radius)
    mask = cv2.warpAffine(
        region.astype(np.uint8) * 255, np.column_stack([turn, shift]), first.shape[::-1]
    )
    features = cv2.goodFeaturesToTrack(first, MAX_FEATURES, 0.05, 3, mask=mask)
    if features is None:
        return np.empty((0, 2)), np.empty((0, 2))
    window_px = int(np.clip(radius, 7, 21))
    options = {"winSize": (window_px, window_px), "maxLevel": 3}
    moved, is_found, _ = cv2.calcOpticalFlowPyrLK(first, second, features, None, **options)
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(second, first, moved, None, **options)
    error = np.linalg.norm((back - features).reshape(-1, 2), axis=1)
    good = (is_found.ravel() > 0) & (is_back.ravel() > 0) & (error < FORWARD_BACKWARD_PX)
    corner = np.array([left, top])
    return features.reshape(-1, 2)[good] + corner, moved.reshape(-1, 2)[good] + corner

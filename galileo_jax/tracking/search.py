"""Finding an object in a frame when it is known roughly, or hardly, where it is."""

import cv2
import numpy as np

from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import rotation
from galileo_jax.tracking.refine import COARSE_PX, FINE_PX, Fit, align
from galileo_jax.tracking.template import Template

SURE = 0.85
"""A fit that correlates better than this ends the search for others."""
CONTRAST = (0.4, 2.5)
"""What shows the template paler or stronger than this is something else."""
TURNS_RAD = (0.0, 0.17, -0.17, 0.35, -0.35)
"""Turns tried in a wide search: the alignment reaches 5 degrees to each side of them."""
MAX_PEAKS = 4


def best_fit(
    picture: Picture, template: Template, guesses: list[tuple[np.ndarray, np.ndarray]]
) -> Fit:
    """The best alignment over guesses, at least one, each a pose and a motion during the exposure.

    The first guess is tried finely at once; then each coarsely, then finely. Stops at the first
    sure one. Fits whose contrast is not the template's count only if there is no other.
    """
    pose, motion = guesses[0]
    best = align(picture, template.target(motion, FINE_PX), pose)
    if _is_sure(best):
        return best
    for pose, motion in guesses:
        coarse = align(picture, template.target(motion, COARSE_PX), pose, steps=6, robust=False)
        fit = align(picture, template.target(motion, FINE_PX), coarse.pose)
        best = max(best, fit, key=_rank)
        if _is_sure(best):
            break
    return best


def _is_sure(fit: Fit) -> bool:
    return is_alike(fit) and fit.correlation > SURE


def is_alike(fit: Fit) -> bool:
    """Whether the patch has about the template's contrast."""
    return CONTRAST[0] <= fit.gain <= CONTRAST[1]


def _rank(fit: Fit) -> tuple[bool, float]:
    return is_alike(fit), fit.correlation


def candidate_poses(
    image: np.ndarray, template: Template, pose: np.ndarray, reach_px: float
) -> list[np.ndarray]:
    """Poses within `reach_px` of `pose` where the template, turned several ways, correlates."""
    rim = template.radius
    size = 2 * rim + 1
    last = np.array(image.shape[::-1]) - 1
    left, top = np.clip(pose[:2] - reach_px, 0, last).astype(int)
    right, bottom = np.clip(pose[:2] + reach_px, 0, last).astype(int)
    padded = cv2.copyMakeBorder(image, rim, rim, rim, rim, cv2.BORDER_REPLICATE)
    window = padded[top : bottom + size, left : right + size]
    window = cv2.GaussianBlur(window, (0, 0), 1.0).astype(np.float32)
    centre = np.array([rim, rim])
    found: list[tuple[float, np.ndarray]] = []
    for turn in TURNS_RAD if template.shows_turns else (0.0,):
        angle = pose[2] + turn
        matrix = rotation(angle)
        warp = np.column_stack([matrix, centre - matrix @ centre])
        turned = cv2.warpAffine(template.image, warp, (size, size), borderMode=cv2.BORDER_REPLICATE)
        mask = cv2.warpAffine(template.region.astype(np.float32), warp, (size, size))
        score = cv2.matchTemplate(window, turned, cv2.TM_CCOEFF_NORMED, mask=mask)
        score[~np.isfinite(score)] = -1
        for _ in range(MAX_PEAKS):
            _, peak, _, (x, y) = cv2.minMaxLoc(score)
            found.append((peak, np.array([left + x, top + y, angle])))
            cv2.circle(score, (x, y), 3, -1, -1)
    found.sort(key=lambda item: -item[0])
    return [pose for _, pose in found[: 2 * MAX_PEAKS]]

"""Finding an object in a frame when it is known roughly, or hardly, where it is."""

import itertools
from dataclasses import dataclass

import cv2
import numpy as np

from galileo_jax.tracking.alignment import COARSE_PX, FINE_PX, Fit, Target, align
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import moved, own_motion, rotation
from galileo_jax.tracking.template import Template

SURE = 0.85  # a fit that correlates better ends the search for others
CONTRAST = (0.4, 2.5)  # what shows the template paler or stronger is something else
TURNS_RAD = (0.0, 0.17, -0.17, 0.35, -0.35)
"""Tried in a wide search; the alignment reaches 5 degrees more."""
MAX_PEAKS = 4
DIRECTIONS, SPEEDS = 16, 6  # of velocities after a blow: smears are then right to a sixth
BLOW_MARGIN_PX = 4.0


@dataclass(frozen=True)
class Guess:
    """Where an object may be, and how picture and template are made alike to be compared."""

    pose: np.ndarray  # to start from
    motion: np.ndarray  # (own axes) in the exposure; the template is smeared by it
    # (own axes) the smear that is in the template; the picture is given it, too. None: it is left
    # as it is
    through: np.ndarray | None = None

    def pair(self, picture: Picture, template: Template, width_px: float) -> tuple[Picture, Target]:
        """What is to be aligned with what."""
        if self.through is not None:
            picture = picture.smeared(rotation(self.pose[2]) @ self.through[:2])
        return picture, template.target(self.motion, width_px, self.through)


def best_fit(picture: Picture, template: Template, guesses: list[Guess]) -> Fit:
    """The best alignment over guesses, at least one.

    The first guess is tried finely at once; then each coarsely, then finely. Stops at the first
    sure one. Fits whose contrast is not the template's count only if there is no other.
    """
    best = align(*guesses[0].pair(picture, template, FINE_PX), guesses[0].pose)
    for guess in guesses:
        if is_alike(best) and best.correlation > SURE:
            break
        rough = guess.pair(picture, template, COARSE_PX)
        coarse = align(*rough, guess.pose, steps=6, robust=False)
        fit = align(*guess.pair(picture, template, FINE_PX), coarse.pose)
        best = max(best, fit, key=lambda one: (is_alike(one), one.correlation))
    return best


def is_alike(fit: Fit) -> bool:
    """Whether the patch has about the template's contrast."""
    return CONTRAST[0] <= fit.gain <= CONTRAST[1]


def candidate_poses(
    image: np.ndarray, template: Template, pose: np.ndarray, reach_px: float
) -> list[np.ndarray]:
    """Poses within `reach_px` of `pose` where the template, turned several ways, correlates."""
    rim = template.radius
    last = np.array(image.shape[::-1]) - 1
    left, top = np.clip(pose[:2] - reach_px, 0, last).astype(int)
    right, bottom = np.clip(pose[:2] + reach_px, 0, last).astype(int)
    padded = cv2.copyMakeBorder(image, rim, rim, rim, rim, cv2.BORDER_REPLICATE)
    window = padded[top : bottom + 2 * rim + 1, left : right + 2 * rim + 1]
    window = cv2.GaussianBlur(window, (0, 0), 1.0).astype(np.float32)
    found: list[tuple[float, np.ndarray]] = []
    for turn in TURNS_RAD if template.shows_turns else (0.0,):
        angle = pose[2] + turn
        score = _score(window, template.image, template.region, angle)
        for _ in range(MAX_PEAKS):
            _, peak, _, (x, y) = cv2.minMaxLoc(score)
            found.append((peak, np.array([left + x, top + y, angle])))
            cv2.circle(score, (x, y), 3, -1, -1)
    found.sort(key=lambda item: -item[0])
    return [pose for _, pose in found[: 2 * MAX_PEAKS]]


def after_blow(
    picture: Picture,
    template: Template,
    pose: np.ndarray,
    velocity: np.ndarray,
    frames: float,
    shares: tuple[float, ...],
    most_px: float,
) -> list[Guess]:
    """Guesses for an object that has been struck since it was last seen, smeared as it then is.

    What moves fast is smeared beyond recognition, but the smear tells where to look: struck at a
    time f after the last frame, `frames` usual steps ago, an object with the velocity v since is at

        pose + f velocity + (frames - f) v,    0 <= f <= 1,    smeared by share v.

    So for velocities of `DIRECTIONS` directions and `SPEEDS` sizes, up to `most_px` per frame, the
    smeared template is looked for where each would have taken it.
    """
    found: list[tuple[float, Guess]] = []
    turns = TURNS_RAD if template.shows_turns else TURNS_RAD[:1]
    for turn, share in itertools.product(turns, shares):
        angle = pose[2] + frames * velocity[2] + turn
        through = None if template.is_sharp else share * template.moved
        shown = picture if through is None else picture.smeared(rotation(angle) @ through[:2])
        speeds = most_px * np.arange(1, SPEEDS + 1) / SPEEDS
        directions = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        for speed, direction in itertools.product(speeds, directions):
            after = speed * np.array([np.cos(direction), np.sin(direction)])
            ends = [pose[:2] + f * velocity[:2] + (frames - f) * after for f in (0, 1)]
            beside = frames * max(np.pi * speed / DIRECTIONS, most_px / SPEEDS / 2)
            reach = beside + BLOW_MARGIN_PX
            low = np.floor(np.minimum(*ends) - reach).astype(int)
            high = np.ceil(np.maximum(*ends) + reach).astype(int)
            window = shown.window(low - template.radius, high + template.radius)
            if window is None:
                continue
            motion = share * own_motion(np.array([*after, velocity[2]]), angle)
            target = template.target(motion, FINE_PX, through)
            score = _score(window, target.image, target.region, angle)
            _, peak, _, (x, y) = cv2.minMaxLoc(score)
            there = np.array([low[0] + x, low[1] + y, angle])
            found.append((peak, Guess(there, motion, through)))
    found.sort(key=lambda item: -item[0])
    return [guess for _, guess in found[: 2 * MAX_PEAKS]]


def _score(window: np.ndarray, image: np.ndarray, region: np.ndarray, angle: float) -> np.ndarray:
    """How the region of a patch, turned by an angle, correlates with each place of a window."""
    turn = np.array([0.0, 0.0, angle])
    mask = moved(region.astype(np.float32), turn, cv2.BORDER_CONSTANT)
    score = cv2.matchTemplate(window, moved(image, turn), cv2.TM_CCOEFF_NORMED, mask=mask)
    score[~np.isfinite(score)] = -1
    return score

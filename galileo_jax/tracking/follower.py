"""First pass: following one object through the frames, and collecting its sharp patches."""

from dataclasses import dataclass, field

import numpy as np

from galileo_jax.tracking.exposure import Exposure, own_motion
from galileo_jax.tracking.lucas_kanade import follow
from galileo_jax.tracking.pose import patch_at
from galileo_jax.tracking.refine import Fit
from galileo_jax.tracking.rigid import rigid_motion
from galileo_jax.tracking.search import SURE, best_fit, candidate_poses
from galileo_jax.tracking.template import Template

FOUND = 0.6
"""Least correlation with the template for an object to count as found."""
SHARP_PX = 1.0
"""An object that moves less than this during the exposure gives a patch for the template."""
MAX_PATCHES = 32


@dataclass
class Follower:
    """Follows one object from frame to frame; `poses` grows by one entry per frame.

    Attributes:
      template: from the first frame, hand and noise included.
      pose: the last one found.
      velocity: change of the pose per frame, extrapolated to the last one.
      poses: pose of every frame so far, NaN where not found.
      patches: sharp aligned patches, thinned evenly to at most `MAX_PATCHES`.
    """

    template: Template
    pose: np.ndarray
    exposure: Exposure
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    mean_velocity: np.ndarray = field(default_factory=lambda: np.zeros(3))
    poses: list[np.ndarray] = field(default_factory=list)
    patches: list[np.ndarray] = field(default_factory=list)
    frames_missed: int = 0
    stride: int = 1
    frames_sharp: int = 0

    def step(self, before: np.ndarray | None, image: np.ndarray) -> None:
        """Finds the object in the next grey frame; `before` is the frame preceding it."""
        fit = self._near(before, image)
        if fit.correlation < SURE:
            other = self._far(image)
            if other is not None and other.correlation > fit.correlation:
                fit = other
        if fit.correlation < FOUND:
            self.poses.append(np.full(3, np.nan))
            self.frames_missed += 1
            return
        if before is not None:
            self.velocity = self._velocity_at(fit.pose)
            self.mean_velocity = (fit.pose - self.pose) / (self.frames_missed + 1)
        self.frames_missed = 0
        self.pose = fit.pose
        self.poses.append(fit.pose)
        self.exposure.add(image, self.template, self.pose, self.velocity)
        self._keep(image)

    def _near(self, before: np.ndarray | None, image: np.ndarray) -> Fit:
        """The best fit around where the object was, went, or is led to by its features."""
        moving = self.pose + (self.frames_missed + 1) * self.velocity
        guesses = [moving, self.pose]
        if before is not None and not self.frames_missed:
            reach = int(np.ceil(2 * np.hypot(*self.velocity[:2]))) + 16
            motion = rigid_motion(*follow(before, image, self.pose, self.template.region, reach))
            if motion is not None:
                angle, shift = motion
                c, s = np.cos(angle), np.sin(angle)
                place = np.array([[c, -s], [s, c]]) @ self.pose[:2] + shift
                guesses.insert(0, np.array([*place, self.pose[2] + angle]))
        return best_fit(image, self.template, [(g, self._smear(g)) for g in guesses])

    def _far(self, image: np.ndarray) -> Fit | None:
        """The best fit in a wide neighbourhood."""
        moving = self.pose + self.velocity
        reach = 2 * np.hypot(*self.velocity[:2]) + 3 * self.template.radius
        guesses = candidate_poses(image, self.template, moving, float(reach))
        if not guesses:
            return None
        return best_fit(image, self.template, [(g, self._smear(g)) for g in guesses])

    def _velocity_at(self, pose: np.ndarray) -> np.ndarray:
        """The velocity at `pose`: the mean one since the last frame plus half its change.

        Without the second term a steadily accelerated object seems slower than it is, and
        the exposure longer. Where the speed changes by more than a half, it was a blow.
        """
        mean = (pose - self.pose) / (self.frames_missed + 1)
        change = mean - self.mean_velocity
        is_blow = np.hypot(*change[:2]) > 0.5 * np.hypot(*mean[:2])
        return mean if is_blow else mean + change / 2

    def _smear(self, pose: np.ndarray) -> np.ndarray:
        return self.exposure.share * own_motion(self._velocity_at(pose), pose[2])

    def _keep(self, image: np.ndarray) -> None:
        if np.hypot(*self.velocity[:2]) * self.exposure.share > SHARP_PX:
            return
        if self.frames_sharp % self.stride == 0:
            self.patches.append(patch_at(image, self.pose, self.template.radius))
            if len(self.patches) > MAX_PATCHES:
                del self.patches[1::2]
                self.stride *= 2
        self.frames_sharp += 1

"""How long the shutter is open, learned from how much moving objects are smeared."""

import numpy as np

from galileo_jax.tracking.alignment import FINE_PX, align
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import length, own_motion
from galileo_jax.tracking.template import Template

SHARES = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.55, 0.75, 1.0])
MIN_SPEED_PX = 3.0  # per frame; slower, the smear is too short to measure
UNLEARNT = (0.0, 0.25, 0.5)  # shares that are tried while fewer than `LEARNT_FRAMES` frames count
LEARNT_FRAMES = 3
SAME_MOTION_PX = 0.3  # motions during the exposure that differ by less are not tried separately
ENOUGH_PX2 = 15e3
"""After moving frames whose speeds' squares add up to this, the share is known to some percent."""


def distinct(motions: list[np.ndarray], radius: int) -> list[np.ndarray]:
    """The `motions` during an exposure that smear a patch of this radius differently."""
    kept: list[np.ndarray] = []
    for motion in motions:
        apart = [motion - other for other in kept]
        if all(length(one) + abs(one[2]) * radius / 2 >= SAME_MOTION_PX for one in apart):
            kept.append(motion)
    return kept


class Exposure:
    """The open share of a frame's time, 0 to 1, from the misfit summed over moving frames."""

    def __init__(self) -> None:
        self.misfit = np.zeros(len(SHARES))
        self.frames = 0
        self.told_px2 = 0.0

    @property
    def share(self) -> float:
        """The share with the least misfit; 0.25 unlearnt.

        What a smear changes grows with its variance: between the shares tried, the misfit is
        taken as a parabola of the share's square.
        """
        if not self.frames:
            return UNLEARNT[1]
        i = int(np.clip(np.argmin(self.misfit), 1, len(SHARES) - 2))
        low, middle, high = SHARES[i - 1 : i + 2] ** 2
        before, after = np.diff(self.misfit[i - 1 : i + 2]) / (middle - low, high - middle)
        if after <= before:
            return float(SHARES[np.argmin(self.misfit)])
        least = (low + middle) / 2 - before * (high - low) / (2 * (after - before))
        return float(np.sqrt(np.clip(least, 0, 1)))

    @property
    def trials(self) -> tuple[float, ...]:
        """The shares worth trying."""
        return UNLEARNT if self.frames < LEARNT_FRAMES else (self.share,)

    def add(
        self, picture: Picture, template: Template, pose: np.ndarray, velocity: np.ndarray
    ) -> None:
        """Counts one frame in, where the object stands at `pose` and moves by `velocity`.

        A template that is smeared itself tells by how much more or less the picture is, not how
        long the shutter is open.
        """
        speed_px, is_enough = length(velocity), self.told_px2 >= ENOUGH_PX2
        if speed_px < MIN_SPEED_PX or not template.is_sharp or is_enough:
            return
        self.frames += 1
        self.told_px2 += speed_px**2
        motion = own_motion(velocity, pose[2])
        for i, share in enumerate(SHARES):
            fit = align(picture, template.target(share * motion, FINE_PX), pose, steps=1)
            self.misfit[i] += 1 - fit.correlation**2

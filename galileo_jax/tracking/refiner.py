"""Second pass: every pose again, against one clean template, with the smear of the motion."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.tracking.alignment import FINE_PX, Target, align, covariance_of
from galileo_jax.tracking.exposure import distinct
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import own_motion, rotation
from galileo_jax.tracking.template import Template


@dataclass(frozen=True)
class Velocities:
    """Changes of the pose per usual step around one frame, `[3]` each: into it and out of it."""

    before: np.ndarray
    after: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """That over both steps."""
        return (self.before + self.after) / 2

    @property
    def jump(self) -> np.ndarray:
        """How much the velocity changes at this frame."""
        return self.after - self.before


def velocities_at(poses: np.ndarray, frame: int, clock: np.ndarray) -> Velocities:
    """The velocities around a frame of `poses` `[frame, 3]`; gaps are bridged.

    `clock` `[frame]` is when each frame was taken, in usual steps.
    """
    known = np.flatnonzero(np.isfinite(poses[:, 0]))
    beside = [*known[known < frame][-1:], *known[known > frame][:1]]
    found = [(poses[at] - poses[frame]) / (clock[at] - clock[frame]) for at in beside]
    found = found or [np.zeros_like(poses[frame])]
    return Velocities(found[0], found[-1])


@dataclass(frozen=True)
class Refined:
    """One frame's final pose; `covariance` `[2, 2]` px^2 of its place, from image noise alone.

    `correlation` and `covered` as in `Fit`; `outside` is the share of the object's region that
    lies beyond the picture's border.
    """

    pose: np.ndarray
    covariance: np.ndarray
    correlation: float
    covered: float
    outside: float


def refine_pose(
    picture: Picture, template: Template, pose: np.ndarray, velocities: Velocities, share: float
) -> Refined:
    """The pose aligned with `template`, smeared by the motion that fits best.

    In a blow the motion during the exposure is that before, that after, or some of both:
    the mean, the earlier and the later velocity are tried, where they differ.
    """
    motions = [
        share * own_motion(velocity, pose[2])
        for velocity in (velocities.mean, velocities.before, velocities.after)
    ]
    targets = [template.target(one, FINE_PX) for one in distinct(motions, template.radius)]
    fits = [(align(picture, target, pose, stretches=True), target) for target in targets]
    best, target = max(fits, key=lambda item: item[0].correlation)
    covariance = covariance_of(best, target, stretches=True)[:2, :2]
    return Refined(
        pose=best.pose,
        covariance=covariance,
        correlation=best.correlation,
        covered=best.covered,
        outside=_outside(picture, template.sharp(FINE_PX), best.pose),
    )


def _outside(picture: Picture, target: Target, pose: np.ndarray) -> float:
    last = np.array(picture.size_px) - 1
    reach = target.reach_px
    if (pose[:2] >= reach).all() and (pose[:2] <= last - reach).all():
        return 0.0
    places = target.places.T @ rotation(pose[2]).T + pose[:2]
    return float(np.mean(((places < 0) | (places > last)).any(axis=1)))

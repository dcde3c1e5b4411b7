"""An observation: what was measured, in metres and seconds, with its errors."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.numerics.least_squares import LinearFit, polynomial

UNMEASURED_SD_M = 10.0
"""Across the way of a motion of which one coordinate was measured: the error says nothing, and is
still small enough for the other's to keep its digits in one covariance."""
AWAY_SD, AWAY_M = 6.0, 3e-4  # an object farther than both from where it stood has moved
STANDING_FRAMES = 5  # that say where it stood
LEAST_SD_M = 1e-6  # smaller errors do not keep their digits beside it
Steps = Float[np.ndarray, " step"]


@dataclass(frozen=True)
class PointPath:
    """Where one object was seen."""

    frames: Int[np.ndarray, " place"]  # their numbers
    times_s: Float[np.ndarray, " place"]
    place_m: Float[np.ndarray, "axis place"]
    variance_m2: Float[np.ndarray, " place"]  # of a coordinate

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def steps(self) -> tuple[Steps, Float[np.ndarray, "axis step"], Steps]:
        """From each place to the next: the time, s, the velocity, m/s, and its sd."""
        step_s = np.diff(self.times_s)
        sd = np.sqrt(self.variance_m2[1:] + self.variance_m2[:-1]) / step_s
        return step_s, np.diff(self.place_m) / step_s, sd

    def __getitem__(self, part: slice | np.ndarray) -> "PointPath":
        """Some of the places: a slice, or which of them."""
        return PointPath(
            self.frames[part], self.times_s[part], self.place_m[:, part], self.variance_m2[part]
        )

    @property
    def gone_m(self) -> Float[np.ndarray, "axis place"]:
        """From the first place to each."""
        return self.place_m - self.place_m[:, :1]

    @property
    def farthest(self) -> int:
        """Which place is farthest from the first in the plane."""
        return int(np.argmax(np.hypot(*self.gone_m[:2])))

    def polynomial(self, degree: int, zero_s: float) -> LinearFit:
        """A polynomial of the time since `zero_s` through the places, highest power first."""
        return polynomial(self.times_s - zero_s, self.place_m.T, degree)


@dataclass(frozen=True)
class Observation:
    """Measured positions of the objects; the model is compared with these.

    Axes: x along the travel (positive in the direction of `Clip.direction`), y up;
    the origin is the foot of the ramp at table level. The point followed is the
    object's centre up to an unknown constant offset of a few millimetres.
    """

    names: tuple[str, ...]  # the objects'
    times_s: Float[np.ndarray, " frame"]
    position_m: Float[np.ndarray, "object axis frame"]  # NaN where `mask` is False
    # Tracking error of each frame, independent between frames
    covariance_m2: Float[np.ndarray, "object 2 2 frame"]
    mask: Bool[np.ndarray, "object frame"]  # True where the point was measured
    # m: errors that many frames share, each as one standard deviation of it moves the track: a
    # number declared about the camera (corners, lens), what a coder repeats of an error
    modes_m: Float[np.ndarray, "mode object axis frame"] | None = None
    # The modes tell how square the camera stands; else it is as good as usual
    is_squared: bool = False
    # How many of `modes_m`, the last, are errors that follow each other in time: unlike
    # imperfections, which a good clip need not have, these are there
    num_errors: int = 0
    is_turning: bool = False  # the third axis is how far each object has turned, rad, not a place
    # How far each puck has turned by its picture, counter-clockwise: to know how it starts, not to
    # be fitted; NaN where nothing shows it, None where nobody looked
    turned_rad: Float[np.ndarray, "object frame"] | None = None
    # How far camera and tracker wander in this clip, m; None where nobody looked
    wander_m: float | None = None
    # How well the size of the tracking errors is known in one stretch of a motion: sd of the
    # logarithm of their variance over what is stated; 0: exactly
    noise_known_to: float = 0.0
    # By the roughness of how many rows the size of the errors is told; 0: it is stated
    rows_of_noise: int = 0

    @property
    def is_tracked_here(self) -> bool:
        """Whether a video was tracked: what others tracked states its errors, and is believed."""
        return self.noise_known_to > 0

    @property
    def sd_m(self) -> Float[np.ndarray, "object axis frame"]:
        """The standard deviation of each coordinate's tracking error, m."""
        return np.sqrt(np.einsum("oaat->oat", self.covariance_m2))

    @property
    def lasting_m(self) -> Float[np.ndarray, "mode object axis frame"]:
        """Those of `modes_m` that are errors which follow each other in time."""
        modes = np.empty((0, *self.position_m.shape)) if self.modes_m is None else self.modes_m
        return modes[len(modes) - self.num_errors :]

    @property
    def across(self) -> Float[np.ndarray, "object axis frame"]:
        """Unit vectors along which nothing was measured; 0 where all axes were, or none."""
        found = np.zeros_like(self.position_m)
        covariance = np.where(self.mask[:, None, None], self.covariance_m2, 0.0)
        trace = np.einsum("oaat->ot", covariance)
        one, frame = np.nonzero(trace >= UNMEASURED_SD_M**2)
        found[one, :, frame] = np.linalg.eigh(covariance[one, :, :, frame])[1][..., -1]
        return found

    @property
    def _measured(self) -> Float[np.ndarray, "object axis axis frame"]:
        """Projections 1 - e e^T on what was measured, e being `across`."""
        across = self.across
        return np.eye(across.shape[1])[:, :, None] - across[:, :, None] * across[:, None]

    def measured_part(
        self, difference_m: Float[np.ndarray, "object axis frame"]
    ) -> Float[np.ndarray, "object axis frame"]:
        """A difference without what lies along directions in which nothing was measured, m.

        It may have the first of the axes alone.
        """
        axes = difference_m.shape[1]
        return np.einsum("oabt,obt->oat", self._measured[:, :axes, :axes], difference_m)

    @property
    def measured_variance_m2(self) -> Float[np.ndarray, "object axis frame"]:
        """The variance of each coordinate of `measured_part` of the tracking errors, m^2."""
        own = self._measured
        return np.einsum("oabt,obct,oact->oat", own, self.covariance_m2, own)

    @property
    def variance_m2(self) -> Float[np.ndarray, "object frame"]:
        """The mean variance of a coordinate of place that was measured, m^2; NaN where none was."""
        axes = 2 if self.is_turning else self.position_m.shape[1]
        trace = np.einsum("oaat->ot", self.covariance_m2[:, :axes, :axes])
        is_line = np.where(self.mask, trace, 0.0) >= UNMEASURED_SD_M**2
        # What is left of the digits of a covariance beside what was not measured.
        along = np.maximum(trace - UNMEASURED_SD_M**2, LEAST_SD_M**2)
        return np.where(is_line, along, trace / axes)

    def path(self, index: int = 0) -> PointPath:
        """Where an object was seen, without how far it had turned."""
        seen = np.flatnonzero(self.mask[index])
        axes = 2 if self.is_turning else self.position_m.shape[1]
        place = self.position_m[index, :axes][:, seen]
        return PointPath(seen, self.times_s[seen], place, self.variance_m2[index, seen])

    def first_away(self, index: int) -> int | None:
        """The frame, among those in which it is seen, from which on an object is away.

        Away from where it stood in the first frames, by more than the errors of its marks; in two
        frames in a row, for one may be an outlier. None where it never is.
        """
        path = self.path(index)
        if not len(path):
            return None
        stood = np.median(path.place_m[:, :STANDING_FRAMES], axis=1, keepdims=True)
        away_m = np.linalg.norm(path.place_m - stood, axis=0)
        is_away = away_m > np.maximum(AWAY_SD * np.sqrt(path.variance_m2), AWAY_M)
        found = path.frames[:-1][is_away[:-1] & is_away[1:]]
        return int(found[0]) if found.size else None

    def apart_m(self, i: int, j: int) -> Float[np.ndarray, " frame"]:
        """The distance of two objects in the plane, m; inf where not both are seen."""
        apart = np.linalg.norm(self.position_m[j, :2] - self.position_m[i, :2], axis=0)
        return np.where(self.mask[i] & self.mask[j], apart, np.inf)

    def without(self, frames: slice, objects: slice | int = slice(None)) -> "Observation":
        """The observation in which objects count as not seen in some frames."""
        mask = self.mask.copy()
        mask[objects, frames] = False
        return replace(self, mask=mask)

    def between(self, frames: slice) -> "Observation":
        """Some of its frames alone."""
        arrays = {name: own for name, own in vars(self).items() if isinstance(own, np.ndarray)}
        return replace(self, **{name: own[..., frames] for name, own in arrays.items()})

    def with_modes(
        self,
        imperfections: Sequence[Float[np.ndarray, "object axis frame"]] = (),
        errors: Sequence[Float[np.ndarray, "object axis frame"]] = (),
    ) -> "Observation":
        """The observation with more `modes_m`: what may be off, and errors."""
        modes = [*imperfections, *(() if self.modes_m is None else self.modes_m), *errors]
        number = self.num_errors + len(errors)
        return replace(self, modes_m=np.stack(modes) if modes else None, num_errors=number)

    @property
    def axes(self) -> tuple[str, ...]:
        """Names of the axes."""
        third = "turning" if self.is_turning else "z"
        return ("x", "y", third)[: self.position_m.shape[1]]

    def offset_m(
        self, predicted_m: Float[np.ndarray, "*batch object axis frame"]
    ) -> Float[np.ndarray, "*batch object axis"]:
        """How far the points followed are from the centres: the median of measured - predicted.

        `predicted_m` may have the first axes only. 0 of an object that is never seen.
        """
        left = self.position_m[:, : predicted_m.shape[-2]] - predicted_m
        found = np.zeros(left.shape[:-1])
        for i in np.flatnonzero(self.mask.any(axis=1)):
            found[..., i, :] = np.median(left[..., i, :, self.mask[i]], axis=0)
        return found

    @property
    def velocity_m_s(self) -> Float[np.ndarray, "object axis frame-1"]:
        """The velocity profile `[object, 2, frame - 1]`, m/s (Galileo's comparison space)."""
        return np.diff(self.position_m, axis=-1) / np.diff(self.times_s)

"""What the poses of a toss say: how the body is thrown, and how high it lies in the end."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from galileo_jax.numerics.least_squares import polynomial
from galileo_jax.observation.poses import Poses

NEAR_SHARE = 0.06  # of the edge: a lowest corner nearer to the plane may touch it in the next frame
FEWEST = 6  # frames of a flight that tell velocity and spin
LAST_FRAMES = 12
STILL_M = 5e-4  # whoever goes no further in its last frames is at rest
FLAT = np.cos(np.radians(2.0))  # one of its axes is upright to within two degrees


@dataclass(frozen=True)
class Flight:
    """The flight of one toss; vectors are `[3]`, at the first frame."""

    last: int  # index of the last frame that is surely free
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    quaternion: np.ndarray  # `[4]`
    spin_rad_s: np.ndarray  # along the world's axes


def _turned(quaternion: np.ndarray) -> Any:
    """The `Rotation` of quaternions, real part first."""
    from scipy.spatial.transform import Rotation  # a third of a second, for tosses alone

    return Rotation.from_quat(quaternion, scalar_first=True)


def last_free_frame(poses: Poses, size_m: Sequence[float] | None) -> int | None:
    """The last frame before any corner is near the plane, about z = 0; None where none ever is.

    Without the box's edges, `size_m`, its lowest place says how large it is.
    """
    lowest = 2 * float(poses.position_m[:, 2].min())
    size = np.full(3, lowest) if size_m is None else np.asarray(size_m)
    reach = np.abs(_turned(poses.quaternion).as_matrix()[:, 2]) @ (size / 2)
    near = poses.position_m[:, 2] - reach <= NEAR_SHARE * float(np.min(size))
    return max(int(np.argmax(near)) - 1, 0) if near.any() else None


def flight_of(poses: Poses, size_m: np.ndarray) -> Flight | None:
    """The flight above a plane near z = 0; None where it has fewer than `FEWEST` frames.

    The spin is that of a body that turns evenly (a cube does; other boxes nearly, so briefly).
    """
    turned = _turned(poses.quaternion)
    found = last_free_frame(poses, tuple(size_m))
    last = len(poses.times_s) - 1 if found is None else found
    if last + 1 < FEWEST:
        return None
    time = poses.times_s[: last + 1] - poses.times_s[0]
    _, velocity, place = polynomial(time, poses.position_m[: last + 1], 2).solution
    since = (turned[: last + 1] * turned[0].inv()).as_rotvec()
    spin, at_first = polynomial(time, since, 1).solution
    first = type(turned).from_rotvec(at_first) * turned[0]
    return Flight(last, place, velocity, first.as_quat(scalar_first=True), spin)


def resting_height_m(tosses: Sequence[Poses]) -> float | None:
    """The median height of the centre, m, over the tosses that end on a face; None: none does."""
    found = []
    for poses in tosses:
        place = poses.position_m[-LAST_FRAMES:]
        is_flat = np.abs(_turned(poses.quaternion[-1]).as_matrix()[2]).max() > FLAT
        if len(place) == LAST_FRAMES and is_flat and np.ptp(place, axis=0).max() < STILL_M:
            found.append(np.median(place[:, 2]))
    return float(np.median(found)) if found else None

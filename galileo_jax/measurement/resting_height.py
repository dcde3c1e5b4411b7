"""How high the centre of a body is when it rests on a face."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.observation.poses import Poses

LAST_FRAMES = 12
STILL_M = 5e-4  # whoever goes no further in its last frames is at rest
FLAT = np.cos(np.radians(2.0))  # one of its axes is upright to within two degrees


def resting_height_m(tosses: Sequence[Poses]) -> float | None:
    """The median height over those tosses that end at rest on a face; None where none does."""
    from scipy.spatial.transform import Rotation  # a third of a second, for tosses alone

    found = []
    for poses in tosses:
        place = poses.position_m[-LAST_FRAMES:]
        turned = Rotation.from_quat(poses.quaternion[-1], scalar_first=True).as_matrix()
        is_flat = np.abs(turned[2]).max() > FLAT
        if len(place) == LAST_FRAMES and is_flat and np.ptp(place, axis=0).max() < STILL_M:
            found.append(np.median(place[:, 2]))
    return float(np.median(found)) if found else None

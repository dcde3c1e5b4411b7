"""Errors of the marks that last: lens, scale, blur, the eye, an encoder.

Smooth ones (Matern's process, nu = 3/2) over a third of the track and over three rows, in each axis
of each body.

Source: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, section 4.2.1.
"""

import numpy as np

from galileo_jax.statespace.term import Patterns, Seen, of_axis, term

LASTS, BRIEFLY = 1 / 3, 3.0  # of the track; rows
LASTING = "the marks are off by {size} for a third of the time"
BRIEF = "the marks are off by {size} for some frames"


def way_m(seen: Seen) -> float:
    """The longest way of a body between two of its places, m; as far as marks may be told apart."""
    observation, longest = seen.observation, 0.0
    for mask, place in zip(observation.mask, observation.position_m, strict=True):
        if mask.any():
            longest = max(longest, float(np.linalg.norm(np.ptp(place[:2, mask], axis=1))))
    return max(longest, 1e-3)


def _smooth(seen: Seen, lasts_s: float) -> Patterns:
    times = seen.observation.times_s
    apart = np.sqrt(3) * np.abs(times[:, None] - times) / max(lasts_s, 1e-9)
    return of_axis((1 + apart) * np.exp(-apart), seen)


def _share_of_way_m(seen: Seen) -> float:
    return 2e-4 * way_m(seen)


@term("lasting_error", LASTING, "m", _share_of_way_m, factor=5.0, is_of_marks=True)
def lasting_error(seen: Seen) -> Patterns:
    """Over a third of the track."""
    return _smooth(seen, LASTS * float(np.ptp(seen.observation.times_s)))


@term("brief_error", BRIEF, "m", _share_of_way_m, factor=5.0, is_of_marks=True)
def brief_error(seen: Seen) -> Patterns:
    """Over three rows."""
    steps = np.diff(seen.observation.times_s)
    return _smooth(seen, BRIEFLY * float(np.median(steps) if steps.size else 1.0))

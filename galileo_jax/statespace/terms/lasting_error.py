"""Errors of the marks that last: lens, scale, blur, the eye, an encoder.

Smooth ones (Matern's process, nu = 3/2) over a third of the track and over three rows, in each axis
of each body.

Source: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, section 4.2.1.
"""

import numpy as np

from galileo_jax.statespace.term import Patterns, Seen, Term, of_axis, register

LASTS, BRIEFLY = 1 / 3, 3.0  # of the track; rows


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


def _long(seen: Seen) -> Patterns:
    return _smooth(seen, LASTS * float(np.ptp(seen.observation.times_s)))


def _brief(seen: Seen) -> Patterns:
    steps = np.diff(seen.observation.times_s)
    return _smooth(seen, BRIEFLY * float(np.median(steps) if steps.size else 1.0))


for name, meaning, patterns in (
    ("lasting_error", "the marks are off by {size} for a third of the time", _long),
    ("brief_error", "the marks are off by {size} for some frames", _brief),
):
    register(
        Term(
            name=name,
            meaning=meaning,
            unit="m",
            median=lambda seen: 2e-4 * way_m(seen),
            factor=5.0,
            patterns=patterns,
            is_of_marks=True,
        )
    )

"""An error of the marks that lasts: lens, scale, blur, the eye, an encoder."""

import numpy as np

from galileo_jax.statespace.term import Patterns, Seen, Term, of_axis, register

LASTS, BRIEFLY = 1 / 6, 3.0  # of the track; rows


def way_m(seen: Seen) -> float:
    """The longest way of a body between two of its places, m; as far as marks may be told apart."""
    observation, longest = seen.observation, 0.0
    for mask, place in zip(observation.mask, observation.position_m, strict=True):
        if mask.any():
            longest = max(longest, float(np.linalg.norm(np.ptp(place[:2, mask], axis=1))))
    return max(longest, 1e-3)


def _patterns(seen: Seen, lasts_s: float) -> Patterns:
    times = seen.observation.times_s
    apart = np.abs(times[:, None] - times)
    return of_axis(np.exp(-apart / max(lasts_s, 1e-9)), seen)


def _long(seen: Seen) -> Patterns:
    times = seen.observation.times_s
    return _patterns(seen, LASTS * float(np.ptp(times)))


def _brief(seen: Seen) -> Patterns:
    times = seen.observation.times_s
    step = float(np.median(np.diff(times))) if len(times) > 1 else 1.0
    return _patterns(seen, BRIEFLY * step)


for name, meaning, patterns in (
    ("lasting_error", "the marks are off by {size} for a sixth of the time", _long),
    ("brief_error", "the marks are off by {size} for some frames", _brief),
):
    register(
        Term(
            name=name,
            meaning=meaning,
            unit="m",
            median=lambda seen: 2e-4 * way_m(seen),
            factor=5.0,
            ordinary=lambda seen: 5e-3 * way_m(seen),
            patterns=patterns,
        )
    )

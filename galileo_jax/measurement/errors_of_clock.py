"""Errors of a track's times that follow each other: what they shift a body by, along its velocity.

Times that a computer gives to a camera's pictures come late when it is busy, and catch up over the
next few: a ball at 10 m/s seems to jump back by centimetres and to make up for it, along its path
and never across. No force does that. Where the places along the path of a track in space show such
errors they are taken into account as `errors_in_time` does for a coordinate.
"""

from dataclasses import replace

import numpy as np

from galileo_jax.measurement.errors_in_time import FAINT, PATHS, shared_errors
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.random_patterns import random_patterns

# Drag changes a flight's acceleration by a part of it: it is smoother than a path that anything may
# disturb.
FLIGHTS = PATHS[PATHS < 500]
TERMS = 5  # numbers of the polynomial that tells the path's direction


def with_errors_of_clock(observation: Observation) -> tuple[Observation, list[str]]:
    """The observation with correlated errors along the velocity, and words for who shows them.

    Args:
      observation: in space; its errors as stated, or told from their roughness.

    Returns:
      the observation: where errors along the velocity follow each other its covariance there is
      their independent part's, and the rest is among `modes_m`; and what was found, in words.
    """
    found, said = [], []
    covariance = observation.covariance_m2.copy()
    for i, name in enumerate(observation.names):
        rows = np.flatnonzero(observation.mask[i])
        if len(rows) <= TERMS:
            continue
        times, places = observation.times_s[rows], observation.position_m[i][:, rows]
        way_m, direction = _along_path(times, places)
        own = covariance[i][:, :, rows]
        variance = np.einsum("ar,abr,br->r", direction, own, direction)
        values = way_m / np.sqrt(np.median(variance))
        shared = shared_errors(times, values, is_once_enough=True, paths=FLIGHTS)
        if shared is None:
            continue
        alone, together = shared
        # As a congruence, so that it stays positive definite: s^2 alone along the path.
        less = np.eye(len(places))[..., None] + (np.sqrt(alone) - 1) * (
            direction[:, None] * direction[None]
        )
        covariance[i][:, :, rows] = np.einsum("abr,bcr,dcr->adr", less, own, less)
        least = FAINT * alone / max(float(np.linalg.eigvalsh(together)[-1]), FAINT)
        for pattern in random_patterns(together, least):
            mode = np.zeros_like(observation.position_m)
            mode[i][:, rows] = pattern * np.sqrt(variance) * direction
            found.append(mode)
        speed = float(np.median(np.abs(np.diff(way_m) / np.diff(times))))
        late_s = float(np.sqrt(together[0, 0] * np.median(variance))) / speed
        said.append(
            f"{name}: its times are off by {1e3 * late_s:.1f} ms over several rows, as "
            "the places along its path show; taken into account"
        )
    if not found:
        return observation, []
    before = [] if observation.modes_m is None else list(observation.modes_m)
    modes = np.stack([*before, *found])
    seen = replace(observation, covariance_m2=covariance, modes_m=modes, num_errors=len(found))
    return seen, said


def _along_path(times_s: np.ndarray, places_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far along a smooth path a row is, `[row]`, m, and the path's direction, `[axis, row]`."""
    since = (times_s - times_s[0]) / (times_s[-1] - times_s[0])
    design = np.vander(since, TERMS)
    smooth = np.linalg.lstsq(design, places_m.T)[0]  # [term, axis]
    powers = np.arange(TERMS - 1, 0, -1)
    velocity = (np.vander(since, TERMS - 1) @ (powers[:, None] * smooth[:-1])).T
    speed = np.linalg.norm(velocity, axis=0)
    direction = velocity / np.maximum(speed, np.finfo(float).tiny)
    steps = np.diff(since) * (speed[1:] + speed[:-1]) / 2
    way_m = np.concatenate([[0.0], np.cumsum(steps)])
    beside = places_m - (design @ smooth).T
    return way_m + np.sum(beside * direction, axis=0), direction

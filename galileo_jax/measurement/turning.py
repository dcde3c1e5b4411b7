"""The turning of pucks that a film shows, as part of the data."""

from dataclasses import replace

import numpy as np

from galileo_jax.clip.plane_noise import position_noise_m
from galileo_jax.observation.observation import Observation

LEAST_RAD = 2e-3  # as well as a picture of a puck shows how it stands
UNSEEN_RAD = 1e3  # the error of what nothing shows: it counts for nothing


def with_turning(observation: Observation) -> Observation:
    """The observation with the pucks' turning, rad, as its third axis.

    Its error is estimated from its roughness. Of a puck that looks alike all round, and in frames
    in which its turning is not known, the error is so large that nothing is told.
    """
    if observation.turned_rad is None:
        return observation
    position, covariance = observation.position_m, observation.covariance_m2
    count, _, frames = position.shape
    turned, variance = np.full((count, frames), np.nan), np.full((count, frames), UNSEEN_RAD**2)
    for i, own in enumerate(observation.turned_rad):
        known = observation.mask[i] & np.isfinite(own)
        turned[i, observation.mask[i]] = 0.0
        if known.any():
            turned[i, known] = np.unwrap(own[known])
            noise = position_noise_m(observation.times_s, np.where(known, turned[i], np.nan))
            variance[i, known] = max(LEAST_RAD, noise if np.isfinite(noise) else 0.0) ** 2
    whole = np.zeros((count, 3, 3, frames))
    whole[:, :2, :2], whole[:, 2, 2] = covariance, variance
    modes = observation.modes_m
    return replace(
        observation,
        position_m=np.concatenate([position, turned[:, None]], axis=1),
        covariance_m2=whole,
        modes_m=None if modes is None else np.pad(modes, [(0, 0), (0, 0), (0, 1), (0, 0)]),
        is_turning=True,
        turned_rad=None,
    )

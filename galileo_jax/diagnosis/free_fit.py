"""Levenberg-Marquardt for one hypothesis with many smooth unknowns, from a good start.

The gradient fit's step solves for clock and camera exactly, in compiled code whose cost grows
with the cube of the number of unknowns: 10 s a step for fifty of them. Here the whole step is
linear, and rollouts are all it costs.
"""

from typing import NamedTuple

import numpy as np

from galileo_jax.comparison.bootstrap import whitened
from galileo_jax.inference.fits.residuals import cost
from galileo_jax.inference.fits.steps import TRIED_SHARE, Damped
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem

# What friction takes up of a constant force is a soft direction: it must be followed to its end.
MAX_STEPS, ENOUGH = 60, 0.005
ALL = np.arange(len(TRIED_SHARE))[None]
NO_EDGES = (np.array(-np.inf), np.array(np.inf))  # accelerations have none
SMALL_STEP = 0.02  # of differences, as a share of a parameter's coarse step


class FreeFit(NamedTuple):
    """A mode and the normal approximation round it.

    Attributes:
      z: `[parameter]`, noise scale last; 0 where pinned.
      free: `[parameter]`.
      covariance: `[model parameter, model parameter]`; 0 where pinned.
      jacobian: `[value, model parameter]`, of the whitened residuals; 0 where pinned.
      residual: `[value]`, whitened at the fitted noise scale.
    """

    z: np.ndarray
    free: np.ndarray
    covariance: np.ndarray
    jacobian: np.ndarray
    residual: np.ndarray


def free_fit(trials: JointProblem, start: np.ndarray, free: np.ndarray) -> FreeFit:
    """Fits one clip.

    Args:
      trials: one clip.
      start: `[parameter]`, z, noise scale last.
      free: `[parameter]`.
    """
    own = np.flatnonzero(free[:-1])
    z = np.where(free, start, 0.0)
    scale = 1.0
    for _ in range(MAX_STEPS):
        jacobian, residual = _slopes(trials, z, free, scale)
        damped = Damped.of(free[None, :-1], [jacobian[None]])
        steps = damped.steps(z[None, None, :-1], [residual[None, None]], NO_EDGES, ALL)[0]
        tried = z + np.pad(steps, [(0, 0), (0, 1)])
        white = _white(trials, tried, free, scale)
        costs = cost([white], tried[:, own])
        best = int(np.nanargmin(costs))
        gain = cost([residual], z[own]) - costs[best]
        if gain > 0:
            z = tried[best]
        normal = jacobian[:, own].T @ jacobian[:, own]
        new_scale = _scale(white[best] * scale, int(trials.num_values), normal)
        settled = abs(new_scale / scale - 1) < 0.05
        scale = new_scale
        if gain < ENOUGH and settled:
            break
    jacobian, residual = _slopes(trials, z, free, scale)
    normal = jacobian[:, own].T @ jacobian[:, own]
    z[-1] = np.log(scale) / NOISE_SD
    return FreeFit(z, free, _covariance(normal, own, len(z) - 1), jacobian, residual)


def _slopes(
    trials: JointProblem, z: np.ndarray, free: np.ndarray, scale: float
) -> tuple[np.ndarray, np.ndarray]:
    """Jacobian `[value, model parameter]` by central differences, and residuals `[value]`.

    Steps are small ones: unknowns are known together and not each alone, so that a step of the
    size of one's own sd would move the whole motion by centimetres.
    """
    own = np.flatnonzero(free[:-1])
    steps = SMALL_STEP * trials.coarse_steps
    offsets = np.zeros((len(own), len(z)))
    offsets[np.arange(len(own)), own] = steps[own]
    white = _white(trials, np.concatenate([z[None], z + offsets, z - offsets]), free, scale)
    high, low = white[1 : 1 + len(own)], white[1 + len(own) :]
    jacobian = np.zeros((white.shape[1], len(z) - 1))
    jacobian[:, own] = ((high - low) / (2 * steps[own])[:, None]).T
    return jacobian, white[0]


def _white(trials: JointProblem, z: np.ndarray, free: np.ndarray, scale: float) -> np.ndarray:
    return whitened(trials, trials.theta(z, free), np.array([scale]))[0]


def _scale(residual: np.ndarray, num_values: int, normal: np.ndarray) -> float:
    """The noise scale that residuals at the tracker's own noise ask for."""
    used = np.trace(normal @ np.linalg.inv(normal + np.eye(len(normal))))
    wide = 1 / (2 * NOISE_SD**2)
    left = max(num_values - used, 1.0)
    return float(np.sqrt((residual @ residual + wide) / (left + wide)))


def _covariance(normal: np.ndarray, own: np.ndarray, count: int) -> np.ndarray:
    covariance = np.zeros((count, count))
    covariance[np.ix_(own, own)] = np.linalg.inv(normal + np.eye(len(own)))
    return covariance

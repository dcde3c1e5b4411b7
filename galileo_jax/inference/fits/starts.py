"""Starts of a search: scattered over what the objects' parameters may be."""

import numpy as np
from scipy.special import ndtri

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import inverse
from galileo_jax.runtime.latin_hypercube import latin_hypercube


def scattered_starts(trials: JointProblem, free: np.ndarray, num: int, seed: int) -> np.ndarray:
    """A Latin hypercube over all but the nuisances, which are where they are absent.

    Args:
      trials: what is to be fitted.
      free: `[model parameter]`, those that are not pinned.
      num: of starts.
      seed: the same seed gives the same starts.

    Returns:
      `[start, model parameter]`, z.
    """
    is_scattered = free & np.array([p.role != "nuisance" for p in trials.model_parameters])
    return scattered_round(trials, absent_z(trials)[None], is_scattered[None], num, seed)


def scattered_round(
    trials: JointProblem, centres: np.ndarray, is_scattered: np.ndarray, num: int, seed: int
) -> np.ndarray:
    """Starts round centres in turn, of which some parameters are known and others scattered.

    Args:
      trials: what is to be fitted.
      centres: `[centre, model parameter]`, z.
      is_scattered: `[centre, model parameter]`, those that are not known.
      num: of starts.
      seed: the same seed gives the same starts.

    Returns:
      `[start, model parameter]`, z.
    """
    turn = np.arange(num) % len(centres)
    some = np.flatnonzero(is_scattered.any(axis=0)).tolist()
    shares = latin_hypercube(num, len(some), np.random.default_rng(seed))
    starts = centres[turn].copy()
    for i, share in zip(some, shares.T, strict=True):
        column = ndtri(np.clip(_in_range(trials, i, share), 0.01, 0.99))
        starts[:, i] = np.where(is_scattered[turn, i], column, starts[:, i])
    return starts


def _in_range(trials: JointProblem, index: int, share: np.ndarray) -> np.ndarray:
    """Shares of a parameter's prior, those of friction within what motion can show."""
    parameter = trials.model_parameters[index]
    if parameter.role != "main" or not parameter.name.startswith("k"):
        return share
    scene = trials.problems[0].model.scene.surroundings
    if parameter.name != "k1" or scene.is_level:
        return 0.5 * share**2 + 0.01  # as many between 0.01 and 0.13 as above
    # Above tan(angle) nothing slides and every start looks alike.
    steepest = min(float(np.tan(scene.angle_rad)), 0.98)
    if not (any(scene.rolls) and scene.rolls[0]):
        return steepest * share + 0.01
    # Half of them where it slips as it rolls: with more friction it rolls alike.
    slips = steepest * scene.roll_inertia[0] / (1 + scene.roll_inertia[0])
    return np.interp(share, [0.0, 0.5, 1.0], [0.0, slips, steepest]) + 0.01


def absent_z(trials: JointProblem) -> np.ndarray:
    """Where nothing but the scene is there, as far as priors reach, `[model parameter]`, z."""
    parameters = trials.model_parameters
    z = inverse(parameters, np.asarray([p.absent for p in parameters]))
    return np.clip(z, -1.0, 1.0)

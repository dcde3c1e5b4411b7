"""Starts of a search: scattered over what the objects' parameters may be."""

import jax.numpy as jnp
import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import inverse


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
    parameters = trials.model_parameters
    scattered = [i for i, p in enumerate(parameters) if p.role != "nuisance" and free[i]]
    share = qmc.LatinHypercube(len(scattered), rng=np.random.default_rng(seed)).random(num)
    starts = np.tile(absent_z(trials), (num, 1))
    angle = trials.problems[0].model.scene.surroundings.angle_rad
    for i, u in zip(scattered, share.T, strict=True):
        if parameters[i].name.startswith("k") and parameters[i].role == "main":
            # Above tan(angle) nothing slides and every start looks alike.
            u = u * min(np.tan(angle) if parameters[i].name == "k1" else 0.5, 0.98) + 0.01
        starts[:, i] = ndtri(np.clip(u, 0.01, 0.99))
    return starts


def absent_z(trials: JointProblem) -> np.ndarray:
    """Where nothing but the scene is there, as far as priors reach, `[model parameter]`, z."""
    parameters = trials.model_parameters
    z = np.asarray(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
    return np.clip(z, -1.0, 1.0)

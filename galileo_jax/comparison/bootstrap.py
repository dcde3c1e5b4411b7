"""The parametric bootstrap: what residuals look like when the fitted model is the truth.

    1. From the fit, draw data: the predicted positions, and errors from the covariance with
       which they were fitted, the modes as large as they are in the data (the likelihood allows
       for imperfections that a good clip need not have); and draw the prior's centre, which is
       data, too. How large errors are is known to some per cent only: those of our tracker are
       larger or smaller than stated in each stretch of a motion (`Observation.noise_known_to`),
       and those that n rows tell by their roughness (`rows_of_noise`) in each coordinate: the
       logarithm of such a variance has the standard deviation `ROUGH` / sqrt(n).
    2. Refit each replicate: Gauss-Newton steps with the fit's Jacobian, each checked with true
       rollouts, so that no residual is taken from a linear model.

Rollouts of all replicates are one batch.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.numerics.normal_matrix import inverse, symmetric_root
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.gaussian_likelihood import is_measured
from galileo_jax.similarity.noise_scale import mode_covariance

NUM_STEPS = 4
ROUGH = 3.0  # of `track_noise.position_noise_m`, where errors are independent and normal


def replicates(
    trials: JointProblem,
    fit: GradientFit,
    noise_scale: np.ndarray,
    mode_size: Sequence[float],
    labels: Sequence[np.ndarray],
    count: int,
    seed: int,
) -> list[np.ndarray]:
    """Whitened residuals of refitted replicates, of each clip `[replicate, value]`.

    The fit's hypothesis, parameters and Jacobian are taken as true. `noise_scale`: `[clip]`, at
    which residuals are whitened; the fit's own may differ. `mode_size`: of each clip, the modes'
    amplitudes over their sd. `labels`: of each clip, `[object, frame]`, the phases of its motion.
    """
    generator = np.random.default_rng([seed, 31])
    free = np.flatnonzero(fit.free[: len(trials.model_parameters)])
    sizes = [problem.observation.position_m.size for problem in trials.problems]
    ends = np.cumsum(sizes)[:-1]
    fitted_scale = trials.theta(fit.z)[len(trials.model_parameters) :]
    # The Jacobian was whitened at the fit's own noise scale.
    rows = np.repeat(fitted_scale / noise_scale, sizes)
    jacobian = fit.jacobian[:, free] * rows[:, None]
    each = zip(trials.problems, noise_scale, mode_size, labels, strict=True)
    noise = np.concatenate([_errors(*one, count, generator) for one in each], axis=1)
    centre = generator.standard_normal((count, len(free)))

    def predicted(z: np.ndarray) -> np.ndarray:
        return np.concatenate(trials.whitened(trials.theta(z, fit.free), noise_scale), axis=1)

    base = predicted(fit.z[None])

    def residual_at(moved: np.ndarray) -> np.ndarray:
        z = np.tile(fit.z, (count, 1))
        z[:, free] += moved
        return noise + predicted(z) - base

    best, _ = _refitted(noise, centre, jacobian, residual_at)
    return np.split(best, ends, axis=1)


def _refitted(
    noise: np.ndarray,
    centre: np.ndarray,
    jacobian: np.ndarray,
    residual_at: Callable[[np.ndarray], np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """What refits of all replicates leave, `[replicate, value]`, and their costs, `[replicate]`."""
    gain = inverse(jacobian.T @ jacobian + np.eye(jacobian.shape[1]))
    moved = np.zeros_like(centre)
    # Where the Jacobian does not hold no step may help: then the truth itself is the fit.
    residual = best = noise
    cost = np.sum(noise**2, axis=1) + np.sum(centre**2, axis=1)
    for _ in range(NUM_STEPS):
        moved = moved - (residual @ jacobian + (moved - centre)) @ gain
        residual = residual_at(moved)
        with np.errstate(over="ignore", invalid="ignore"):  # gone beyond all numbers: no better
            now = np.sum(residual**2, axis=1) + np.sum((moved - centre) ** 2, axis=1)
        improves = now < cost
        best, cost = np.where(improves[:, None], residual, best), np.where(improves, now, cost)
    return best, cost


def _errors(
    problem: Problem,
    noise_scale: float,
    mode_size: float,
    label: np.ndarray,
    count: int,
    generator: np.random.Generator,
) -> np.ndarray:
    """Whitened errors of a clip, `[replicate, value]`: the tracker's, and modes of a size.

    0 where nothing was measured.
    """
    data, errors = problem.data, problem.errors_in_full
    gain2, basis = data.gain**2, data.rows
    found = generator.standard_normal((count, problem.observation.position_m.size))
    seen = problem.observation
    if seen.noise_known_to or seen.rows_of_noise:
        found = found * _uneven(seen, label, count, generator)
    # Drawn as values and seen along the modes: these are unit normals, too, and the replicates do
    # not depend on the modes' signs, which rounding decides.
    along = generator.standard_normal(found.shape) @ basis.T
    if errors is None:
        along = along * (mode_size * data.gain)
    else:
        along = along @ symmetric_root(mode_covariance(0.0, mode_size, data, errors))
    own = found @ basis.T
    left = noise_scale / np.sqrt(noise_scale**2 + gain2)
    found = found + ((own + along / noise_scale) * left - own) @ basis
    return found * is_measured(data.inverse_root).reshape(-1)


def _uneven(
    observation: Observation, label: np.ndarray, count: int, generator: np.random.Generator
) -> np.ndarray:
    """How large errors are over stated errors, `[replicate, value]`."""
    known_to, (objects, axes, frames) = observation.noise_known_to, observation.position_m.shape
    if rows := observation.rows_of_noise:
        known_to, label = ROUGH / math.sqrt(rows), np.zeros_like(label)
    log_variance = known_to * generator.standard_normal((count, objects, axes, label.max() + 1))
    each = np.exp((log_variance - known_to**2 / 2) / 2)  # of a mean square of 1
    index = np.broadcast_to(label[:, None], (count, objects, axes, frames))
    return np.take_along_axis(each, index, axis=-1).reshape(count, -1)

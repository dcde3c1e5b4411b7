"""The gradient fit: multi-start Levenberg-Marquardt and a Laplace posterior.

    1. Roll out `num_starts` scattered parameter vectors in one batch; keep the best few.
    2. Refine those by Levenberg-Marquardt (optimistix), vmapped, on
       [ C^-1/2 (observed - predicted(z)) ; z ], the prior being the second block.
    3. Set the difference steps to half the posterior's standard deviations and refine the
       best once more; estimate the noise scale on the way.
    4. Posterior: normal in z with covariance (J^T J + 1)^-1.

A single far start ends in a side valley in most cases (the time of the collision decides
which frames compare with which); the scattered starts cost one batch.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from scipy.stats import norm, qmc

from galileo_jax.inference.problem import FAILED, NOISE_SD, Problem
from galileo_jax.parameters import inverse


@dataclass(frozen=True)
class Settings:
    """How hard to search.

    Attributes:
      num_starts: scattered parameter vectors.
      num_refined: of these, how many are refined at the most.
      good_chi2_per_value: below it no further start is refined.
      max_steps: of one Levenberg-Marquardt run from a scattered start.
      max_polish_steps: of one run at the fit.
      coarse_tolerance: of z and of the sum of squares on the way to the fit.
      tolerance: of the last refinement, in posterior standard deviations.
      converged_sd: converged where the last refinement moved no combination of parameters
        by more than this many posterior standard deviations.
    """

    num_starts: int = 64
    num_refined: int = 4
    good_chi2_per_value: float = 2.0
    max_steps: int = 12
    max_polish_steps: int = 4
    coarse_tolerance: float = 3e-2
    tolerance: float = 0.1
    converged_sd: float = 0.5


class Code(StrEnum):
    """How a fit ended; the value is the sentence for the user."""

    CONVERGED = "the fit converged"
    STEP_LIMIT = "the step limit came before convergence; try more starts or --method mh"
    FAILED = "no rollout succeeded; check the clip's geometry"


@dataclass(frozen=True)
class GradientFit:
    """The best fit and the normal approximation round it.

    Attributes:
      z: `[parameter]`, the mode, noise scale last.
      covariance: `[parameter, parameter]`, in z.
      chi2: sum of squared whitened residuals at the tracker's own noise (scale 1).
      num_values: how many numbers were measured.
      steps: `[model parameter]`, the difference steps of the final Jacobian, in z.
      jacobian: `[value, model parameter]`, d(whitened residual)/dz at the fit.
      code: how it ended.
      stats: rollouts, steps.
    """

    z: np.ndarray
    covariance: np.ndarray
    chi2: float
    num_values: int
    steps: np.ndarray
    jacobian: np.ndarray
    code: Code
    stats: dict[str, float]


class GradientFitter:
    """Compiled once for a problem's shapes; `fit` may be called for many seeds."""

    def __init__(self, problem: Problem, settings: Settings = Settings()):
        self.problem, self.settings = problem, settings

        def cost(z, steps):
            return 0.5 * (jnp.sum(problem.residuals(z, 1.0, steps) ** 2) + jnp.sum(z**2))

        def objective(u, args, is_coarse):
            centre, root, noise_scale, steps = args
            z = centre + root @ u
            return jnp.concatenate([problem.residuals(z, noise_scale, steps, is_coarse), z])

        def refine(centre, root, noise_scale, steps, is_coarse, tolerance, max_steps):
            solution = optx.least_squares(
                lambda u, args: objective(u, args, is_coarse),
                optx.LevenbergMarquardt(rtol=tolerance, atol=tolerance),
                jnp.zeros_like(centre),
                args=(centre, root, noise_scale, steps),
                max_steps=max_steps,
                throw=False,
            )
            moved = jnp.max(jnp.abs(solution.value))
            return centre + root @ solution.value, moved, solution.stats["num_steps"]

        def linearised(z, noise_scale, steps):
            def residuals(x):
                value = problem.residuals(x, noise_scale, steps)
                return value, value

            jacobian, residual = jax.jacfwd(residuals, has_aux=True)(z)
            return residual, jacobian

        self._cost = jax.jit(jax.vmap(cost, (0, None)))
        self._approach = jax.jit(
            lambda *a: refine(*a, True, settings.coarse_tolerance, settings.max_steps)
        )
        self._polish = jax.jit(
            lambda *a: refine(*a, False, settings.tolerance, settings.max_polish_steps)
        )
        self._linearised = jax.jit(linearised)
        self._residuals = jax.jit(problem.residuals)

    def fit(self, seed: int, on_stage: Callable[[str], None] = lambda _: None) -> GradientFit:
        """Fits; the same seed gives the same result."""
        settings = self.settings
        z, num_steps = self._search(seed, on_stage)
        on_stage("refining")
        steps = jnp.asarray(self.problem.coarse_steps)
        noise_scale, moved = 1.0, jnp.inf
        identity = np.eye(len(z))
        for _ in range(2):
            residual, jacobian = self._linearised(z, noise_scale, steps)
            covariance = _covariance(jacobian)
            steps = _half_sd(covariance)
            noise_scale *= self._noise_factor(residual, float(np.trace(identity - covariance)))
            root = jnp.asarray(np.linalg.cholesky(covariance))
            z, moved, used = self._polish(z, root, noise_scale, steps)
            num_steps += int(used)
        residual, jacobian = self._linearised(z, noise_scale, steps)
        at_unit = np.asarray(self._residuals(z, 1.0, steps))
        count = int(self.problem.data.num_values)
        whole = np.zeros((len(z) + 1,) * 2)
        whole[:-1, :-1] = _covariance(jacobian)
        whole[-1, -1] = 1 / (1 + 2 * count * NOISE_SD**2)
        code = Code.CONVERGED if float(moved) < settings.converged_sd else Code.STEP_LIMIT
        if np.abs(at_unit).max() >= FAILED:
            code = Code.FAILED
        return GradientFit(
            z=np.append(np.asarray(z), np.log(noise_scale) / NOISE_SD),
            covariance=whole,
            chi2=float(np.sum(at_unit**2)),
            num_values=count,
            steps=np.asarray(steps),
            jacobian=np.asarray(jacobian),
            code=code,
            stats={"num_steps": num_steps, "num_starts": settings.num_starts},
        )

    def _search(self, seed: int, on_stage: Callable[[str], None]) -> tuple[jax.Array, int]:
        """The best of the refined starts, z, and how many steps that took."""
        settings = self.settings
        on_stage("searching")
        steps = jnp.asarray(self.problem.coarse_steps)
        starts = jnp.asarray(self._starts(seed))
        order = np.argsort(np.asarray(self._cost(starts, steps)))
        on_stage("approaching")
        count = float(self.problem.data.num_values)
        best, best_cost, num_steps = starts[order[0]], np.inf, 0
        for start in starts[order[: settings.num_refined]]:
            z, _, used = self._approach(start, jnp.eye(len(start)), 1.0, steps)
            num_steps += int(used)
            cost = float(self._cost(z[None], steps)[0])
            if cost < best_cost:
                best, best_cost = z, cost
            if best_cost < 0.5 * settings.good_chi2_per_value * count:
                break
        return best, num_steps

    def _noise_factor(self, residual: jax.Array, effective: float) -> float:
        """The factor on the noise scale that the residuals ask for, prior included."""
        count = float(self.problem.data.num_values)
        wide = 1 / (2 * NOISE_SD**2)  # the prior is worth this many values
        total = float(jnp.sum(residual**2))
        return float(np.sqrt((total + wide) / (max(count - effective, 1.0) + wide)))

    def _starts(self, seed: int) -> np.ndarray:
        """Scattered starts in z: main parameters by a Sobol sequence, all others at rest."""
        parameters = self.problem.model.parameters
        rest = np.array(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
        rest = np.clip(rest, -1.0, 1.0)  # an absent half-normal has no slope
        free = [i for i, p in enumerate(parameters) if p.role == "main"]
        sobol = qmc.Sobol(len(free), seed=seed)
        share = sobol.random_base2(int(np.ceil(np.log2(self.settings.num_starts))))
        starts = np.tile(rest, (self.settings.num_starts, 1))
        angle = self.problem.model.scene.surroundings.angle_rad
        for column, i in enumerate(free):
            u = share[: self.settings.num_starts, column]
            if parameters[i].name.startswith("k"):
                u = u * min(np.tan(angle) if parameters[i].name == "k1" else 0.5, 0.98) + 0.01
            starts[:, i] = norm.ppf(np.clip(u, 0.01, 0.99))
        return starts


def _covariance(jacobian: jax.Array) -> np.ndarray:
    """The Laplace covariance of z, [parameter, parameter], prior included."""
    return np.linalg.inv(np.asarray(jacobian.T @ jacobian) + np.eye(jacobian.shape[1]))


def _half_sd(covariance: np.ndarray) -> jax.Array:
    """Difference steps at the posterior's scale: half its standard deviations, in z."""
    return jnp.asarray(np.clip(0.5 * np.sqrt(np.diag(covariance)), 1e-4, 0.5))

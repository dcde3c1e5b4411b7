"""What a fit is, and Laplace's approximation round it: covariance and evidence."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from galileo_jax.inference.fits.programs import FAILED
from galileo_jax.inference.fits.residuals import Batch, Residuals, Slopes, cost, quadratic
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood


class Code(StrEnum):
    """How a fit ended; the value is the sentence for the user."""

    CONVERGED = "the fit converged"
    STEP_LIMIT = "the fit has not settled; try another --seed or --method mh"
    FAILED = "no rollout succeeded; check the clip's geometry"


@dataclass(frozen=True)
class GradientFit:
    """The best fit of one hypothesis and the normal approximation round it.

    Attributes:
      z: `[parameter]`, the mode, noise scales last; 0 where pinned.
      free: `[parameter]`, which parameters the hypothesis has.
      covariance: `[parameter, parameter]`, in z; 0 where pinned.
      chi2: sum of squared whitened residuals at the tracker's own noise (scale 1).
      log_evidence: of the hypothesis, by Laplace, up to the data's constant.
      num_values: how many numbers were measured.
      steps: `[model parameter]`, the difference steps of the final Jacobian, in z.
      jacobian: `[value, model parameter]`, d(whitened residual)/dz at the fit, clip after clip;
        values as in `Problem.whiten`; 0 where pinned.
      code: how it ended.
      stats: rollouts and steps it took.
      pull: how far the nuisances are from their priors' middle: the sum of their squared z.
    """

    z: np.ndarray
    free: np.ndarray
    covariance: np.ndarray
    chi2: float
    log_evidence: float
    num_values: int
    steps: np.ndarray
    jacobian: np.ndarray
    code: Code
    stats: dict[str, float]
    pull: float

    @property
    def num_used(self) -> float:
        """How many numbers' worth of the data the parameters were fitted with."""
        count = len(self.steps)
        return float(np.sum(self.free[:count]) - np.trace(self.covariance[:count, :count]))


def laplace_fits(
    trials: JointProblem,
    residuals: Residuals,
    points: Batch,
    steps: np.ndarray,
    is_settled: np.ndarray,
    num_steps: int,
) -> list[GradientFit]:
    """The normal approximations round modes.

    Args:
      trials: what was fitted.
      residuals: of the trials.
      points: the modes.
      steps: `[point, model parameter]`, of differences, in z.
      is_settled: `[point]`.
      num_steps: that it took.
    """
    slopes = residuals.slopes(points, steps, is_central=True)
    return [
        _laplace_fit(trials, residuals, points, slopes, i, steps[i], bool(is_settled[i]), num_steps)
        for i in range(len(points.z))
    ]


def _laplace_fit(
    trials: JointProblem,
    residuals: Residuals,
    points: Batch,
    slopes: Slopes,
    i: int,
    steps: np.ndarray,
    is_settled: bool,
    num_steps: int,
) -> GradientFit:
    """That of point i."""
    z, scale, clips = points.z[i], points.noise[i], residuals.clips
    white = [w[i] for w in slopes.white]
    covariance = _covariance(slopes, points, i, residuals)
    free = np.append(points.free[i], np.ones(len(scale), bool))
    failed = max(float(np.abs(w).max()) for w in white) >= FAILED
    code = Code.CONVERGED if is_settled else Code.STEP_LIMIT
    rows = [clip.unpadded(j[i]) for clip, j in zip(clips, slopes.jacobian, strict=True)]
    is_nuisance = np.array([p.role == "nuisance" for p in trials.model_parameters])
    return GradientFit(
        z=np.append(z, np.log(scale) / NOISE_SD),
        free=free,
        covariance=covariance,
        chi2=sum(float(np.sum((w * s) ** 2)) for w, s in zip(white, scale, strict=True)),
        log_evidence=_log_evidence(z, scale, white, covariance[np.ix_(free, free)], residuals),
        num_values=trials.num_values,
        steps=steps,
        jacobian=np.concatenate(rows),
        code=Code.FAILED if failed else code,
        stats={"num_steps": num_steps, "num_rollouts": residuals.num_rollouts},
        pull=float(np.sum(z[is_nuisance] ** 2)),
    )


def _covariance(slopes: Slopes, points: Batch, i: int, residuals: Residuals) -> np.ndarray:
    """Of z at point i, noise scales last; 0 where pinned."""
    count, own = points.z.shape[1], np.flatnonzero(points.free[i])
    whole = np.zeros((count + len(residuals.clips),) * 2)
    normal = quadratic(slopes, points.z).normal[i]
    whole[np.ix_(own, own)] = np.linalg.inv(normal[np.ix_(own, own)])
    for c, (clip, scale) in enumerate(zip(residuals.clips, points.noise[i], strict=True)):
        degrees = float(GaussianLikelihood.degrees(scale, clip.data.whitening))
        whole[count + c, count + c] = 1 / (1 + 2 * degrees * NOISE_SD**2)
    return whole


def _log_evidence(
    z: np.ndarray,
    scale: np.ndarray,
    white: list[np.ndarray],
    covariance: np.ndarray,
    residuals: Residuals,
) -> float:
    """Laplace: the density at the mode times the posterior's volume over the prior's."""
    total = -float(cost(white, z)) - 0.5 * float(np.sum((np.log(scale) / NOISE_SD) ** 2))
    for clip, s in zip(residuals.clips, scale, strict=True):
        total -= 0.5 * float(GaussianLikelihood.log_determinant(s, clip.data.whitening))
    return total + 0.5 * float(np.linalg.slogdet(covariance)[1])

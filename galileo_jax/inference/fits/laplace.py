"""What a fit is, and Laplace's approximation round it: covariance and evidence."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.inference.fits.descent import Polished
from galileo_jax.inference.fits.kernels import FAILED
from galileo_jax.inference.fits.residuals import Batch, Residuals, cost, quadratic
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.model.parameters import prior_deviations
from galileo_jax.numerics.normal_matrix import inverse
from galileo_jax.similarity.noise_scale import errors_at
from galileo_jax.statespace.sizes import Sizes


class Code(StrEnum):
    """How a fit ended; the value is the sentence for the user."""

    CONVERGED = "the fit converged"
    MISFIT = (
        "the fit converged, but noise does not explain the residuals, even after a second search"
    )
    STEP_LIMIT = "the fit has not converged; try another --seed or --method mh"
    FAILED = "no simulation succeeded; check the clip's geometry"


@dataclass(frozen=True)
class GradientFit:
    """The best fit of one hypothesis and the normal approximation round it."""

    z: Float[np.ndarray, " parameter"]  # the mode, noise scales last; 0 where pinned
    free: Bool[np.ndarray, " parameter"]  # which parameters the hypothesis has
    covariance: Float[np.ndarray, "parameter parameter"]  # in z; 0 where pinned
    chi2: float  # sum of the squared tracking errors that are left, in units of the stated noise
    log_evidence: float  # of the hypothesis, by Laplace, up to the data's constant
    num_values: int  # how many numbers were measured
    # difference steps of the final Jacobian, in z
    steps: Float[np.ndarray, " model_parameter"]
    # d(whitened residual)/dz at the fit, clip after clip; values as in `Problem.whiten`; 0 where
    # pinned
    jacobian: Float[np.ndarray, "value model_parameter"]
    code: Code  # how it ended
    stats: dict[str, float]  # rollouts it took
    # how far the nuisances are from what is expected: the sum of the squares of their
    # `prior_deviations`
    pull: float
    num_pulled: float  # how many numbers' worth of the data the nuisances were fitted with
    # fits in other valleys that explain the data about as well; they share the posterior
    beside: tuple["GradientFit", ...] = ()
    sizes: Sizes | None = None  # of imperfections, with which it was fitted; None: there are none

    def points(self, z: Float[np.ndarray, "point parameter"]) -> Batch:
        """Points with this fit's own noise and parameters."""
        count = len(self.steps)
        free = np.broadcast_to(self.free[:count], (len(z), count))
        noise = np.exp(NOISE_SD * self.z[count:])
        return Batch(z[:, :count], free, np.tile(noise, (len(z), 1)))

    @property
    def num_fitted(self) -> float:
        """`num_used` by all but the nuisances, whose pulls count as data."""
        return self.num_used - self.num_pulled

    @property
    def num_used(self) -> float:
        """How many numbers' worth of the data the parameters were fitted with."""
        count = len(self.steps)
        return float(np.sum(self.free[:count]) - np.trace(self.covariance[:count, :count]))


def points_of(fits: Sequence[GradientFit]) -> Batch:
    """Where fits are."""
    each = zip(*(fit.points(fit.z[None]) for fit in fits), strict=True)
    return Batch(*(np.concatenate(leaves) for leaves in each))


def laplace_fits(trials: JointProblem, residuals: Residuals, found: Polished) -> list[GradientFit]:
    """The normal approximations round the modes that were found."""
    slopes = residuals.slopes(found.points, found.widths, sides="open")
    normal = quadratic(slopes, found.points.z).normal
    jacobian = [slopes.among_all(own, axis=2) for own in slopes.jacobian]
    is_nuisance = np.array([p.role == "nuisance" for p in trials.model_parameters])
    clips, fits = residuals.clips, list[GradientFit]()
    for i, (z, is_free, scale) in enumerate(zip(*found.points, strict=True)):
        white = [w[i] for w in slopes.white]
        covariance = _covariance(normal[i], is_free, scale, residuals)
        free = np.append(is_free, np.ones(len(scale), bool))
        failed = max(float(np.abs(w).max()) for w in white) >= FAILED
        code = Code.CONVERGED if found.is_settled[i] else Code.STEP_LIMIT
        rows = [clip.unpadded(j[i]) for clip, j in zip(clips, jacobian, strict=True)]
        errors = [
            errors_at(w[None], s[None], np.ones(1), clip.whitening)
            for w, s, clip in zip(white, scale, clips, strict=True)
        ]
        fit = GradientFit(
            z=np.append(z, np.log(scale) / NOISE_SD),
            free=free,
            covariance=covariance,
            chi2=sum(float(np.sum(own**2)) for own in errors),
            log_evidence=_log_evidence(z, scale, white, covariance[np.ix_(free, free)], residuals),
            num_values=trials.num_values,
            steps=found.widths[i],
            jacobian=np.concatenate(rows),
            code=Code.FAILED if failed else code,
            stats={"num_rollouts": residuals.num_rollouts},
            pull=float(np.sum(prior_deviations(trials.model_parameters, z) ** 2)),
            num_pulled=float(np.sum(1 - np.diag(covariance)[: len(z)][is_free & is_nuisance])),
        )
        fits.append(fit)
    return fits


def _covariance(
    normal: np.ndarray, free: np.ndarray, scale: np.ndarray, residuals: Residuals
) -> np.ndarray:
    """Of z, noise scales last; 0 where pinned."""
    count, own = len(free), np.flatnonzero(free)
    whole = np.zeros((count + len(scale),) * 2)
    whole[np.ix_(own, own)] = inverse(normal[np.ix_(own, own)])
    for c, (clip, s) in enumerate(zip(residuals.clips, scale, strict=True)):
        information = float(clip.whitening.information(s))
        whole[count + c, count + c] = 1 / (1 + information * NOISE_SD**2)
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
        total -= 0.5 * float(clip.whitening.log_determinant(s))
    return total + 0.5 * float(np.linalg.slogdet(covariance)[1])

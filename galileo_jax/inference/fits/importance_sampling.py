"""Weighed draws of a posterior: rollouts round the fit, each with its weight by importance.

    w_i = p(z_i) / q(z_i),    z_i ~ q

Where the posterior is normal, all weights are alike. Where it is skewed, bent or cut off by the end
of a prior, they are not, and with their weights the draws are of the posterior all the same.

q has a part for each valley that was found: Student's t along it (`transport_map.py`), so that
valleys add up and do not count twice where they overlap. One that bends too much for that has a
second part, which follows its ridge (`profile_proposal.py`).

Where few draws count all the same, further ones learn from them (`adaptive_mixture.py`).

Source: J. Geweke, Bayesian inference in econometric models using Monte Carlo integration,
Econometrica 57 (1989), 1317 (the t).
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from galileo_jax.inference.fits.adaptive_mixture import AdaptiveMixture, Part
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.profile_proposal import bent_direction, ridge_along
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.fits.t_proposal import log_student_t, student_t
from galileo_jax.inference.fits.transport_map import Valley, valley_round
from galileo_jax.inference.joint_problem import NOISE_SD
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

NUM_DRAWS, MOST_DRAWS = 256, 1536  # at once, and in all where few of them count
ENOUGH_ESS = 40.0  # a mean is good to a sixth of its sd
BETTER_NATS = 0.5  # by which a draw beats all fits where these are not at their best
SHARE_RIDGE = 0.75  # of a valley's draws, where it bends too much


@dataclass(frozen=True)
class Weighed:
    """Weighed draws of a posterior.

    Attributes:
      log_weights: `[draw]`.
      ess: how many draws of the posterior itself these are worth.
      z: `[draw, parameter]`.
      log_density: `[draw]`, of the posterior, up to a constant.
      better: `[parameter]`, z of a draw that is more probable than all fits; None: none is.
    """

    log_weights: Float[np.ndarray, " draw"]
    ess: float
    z: Float[np.ndarray, "draw parameter"]
    log_density: Float[np.ndarray, " draw"]
    better: Float[np.ndarray, " parameter"] | None = None


@dataclass(frozen=True)
class _AlongValley:
    """A part of q: a t along a valley."""

    valley: Valley
    free: np.ndarray  # [parameter], which are moved

    def draw(self, generator: np.random.Generator, num: int) -> tuple[np.ndarray, np.ndarray]:
        """Points, and their log density in this part."""
        u = student_t(generator, num, self.valley.root.shape[1])
        return np.array(self.valley(u)), self._log_density_at(u)

    def log_density(self, z: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):  # far off, where it draws none
            u = self.valley.inverse(z, self.free)
        return self._log_density_at(u)

    def _log_density_at(self, u: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):
            far = np.nan_to_num(np.sum(u**2, axis=1), nan=np.inf)
        return log_student_t(far, u.shape[1]) - self.valley.log_volume


def weighed(
    fits: Sequence[GradientFit],
    residuals: Residuals,
    seed: int,
    num: int = NUM_DRAWS,
    most: int = MOST_DRAWS,
    enough: float = ENOUGH_ESS,
    density: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Weighed:
    """Weighed draws of the posterior of a hypothesis.

    Args:
      fits: of the hypothesis, the best of each valley.
      residuals: of the trials that were fitted.
      seed: same seed, same draws.
      num: of draws at once, a rollout each.
      most: of draws in all; more than `num` only while too few of them count.
      enough: draws of the posterior itself that they must be worth.
      density: of likelihood times exp(-z.z / 2), its logarithm at `[point, parameter]`, up to a
        constant; default: at the sizes of imperfections that were fitted with.
    """
    fit, generator = fits[0], np.random.default_rng([seed, 23])
    density = density or functools.partial(_log_densities, fit, residuals)
    parts, shares = _parts(fits, residuals)
    # The prior's constant; that of the data is the same for all hypotheses.
    constant = np.sum(fit.free) / 2 * np.log(2 * np.pi)
    modes = np.stack([one.z for one in fits])
    best, better, made = -np.inf, None, AdaptiveMixture(parts, shares, fit.free)
    while len(made.z) < num or (made.ess < enough and len(made.z) < most):
        new = made.draw(generator, num)
        both = density(np.concatenate([new, modes]))
        made.add(both[:num] - constant)
        best = max(best, both[num:].max() + BETTER_NATS)
        if both[:num].max() > best:
            best, better = float(both[:num].max()), new[np.argmax(both[:num])]
    return Weighed(made.log_weights, made.ess, made.z, made.log_density, better)


def _parts(fits: Sequence[GradientFit], residuals: Residuals) -> tuple[list[Part], np.ndarray]:
    """Those of the valleys, and which shares of the draws they have."""
    parts, shares = list[Part](), list[float]()
    for one in fits:
        part = _AlongValley(valley_round(one, residuals), one.free)
        parts.append(part)
        shares.append(1 / len(fits))
        direction = bent_direction(part.valley)
        ridge = None if direction is None else ridge_along(one, part.valley, direction, residuals)
        if ridge is not None:
            parts.append(ridge)
            shares[-1:] = [(1 - SHARE_RIDGE) * shares[-1], SHARE_RIDGE * shares[-1]]
    return parts, np.array(shares)


def _log_densities(fit: GradientFit, residuals: Residuals, z: np.ndarray) -> np.ndarray:
    """Of likelihood times exp(-z.z / 2), noise scales being free, `[point]`."""
    count = len(fit.steps)
    noise = np.exp(NOISE_SD * z[:, count:])
    free = np.broadcast_to(fit.free[:count], (len(z), count))
    found = -residuals.costs(Batch(z[:, :count], free, noise))
    found = found - 0.5 * np.sum(z[:, count:] ** 2, axis=1)
    for clip, scales in zip(residuals.clips, noise.T, strict=True):
        data = clip.data.whitening
        found -= 0.5 * np.array([GaussianLikelihood.log_determinant(s, data) for s in scales])
    return found

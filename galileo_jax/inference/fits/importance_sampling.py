"""The evidence of a hypothesis by importance: Laplace's, mended by a few rollouts round the fit.

    Z = mean of  p(z_i) / q(z_i),    z_i ~ q

Where the posterior is normal, all weights are alike and Z is Laplace's. Where it is skewed, bent or
cut off by the end of a prior, they are not, and their mean is the evidence all the same. How much
they differ says how good it is: the error of log Z is about sqrt(1 / ess - 1 / num).

q has a part for each valley that was found: Student's t along it (`transport_map.py`), so that
valleys add up and do not count twice where they overlap. One that bends too much for that has a
second part, which follows its ridge (`profile_proposal.py`). Where the hypothesis is hardly better
than the one without its last effect, a quarter of the draws come from there: all else along that
one's valley, the effect's own parameters from their priors. While an effect is too weak to show,
its place or its speed may be anything, and Laplace at the best of them sees nothing of that.

Where few draws count all the same, further ones learn from them (`adaptive_mixture.py`).

Source: J. Geweke, Bayesian inference in econometric models using Monte Carlo integration,
Econometrica 57 (1989), 1317 (the t).
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.adaptive_mixture import AdaptiveMixture, Part
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.profile_proposal import bent_direction, ridge_along
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.fits.t_proposal import log_student_t, student_t
from galileo_jax.inference.fits.transport_map import Valley, valley_round
from galileo_jax.inference.joint_problem import NOISE_SD
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

NUM_DRAWS, MOST_DRAWS = 256, 1536  # at once, and in all where few of them count
ENOUGH_ESS = 40.0  # the error is a sixth of a nat
LEAST_ESS = 10.0  # of so many the error is a third of a nat; of fewer nobody knows it
BETTER_NATS = 0.5  # by which a draw beats all fits where these are not at their best
SHARE_WITHOUT = 0.25  # of the draws, from the hypothesis without its last effect
SHARE_RIDGE = 0.75  # of a valley's draws, where it bends too much
HARDLY_BETTER = 10.0  # nats: beyond, an effect too weak to show is e^-10 of the evidence


@dataclass(frozen=True)
class Weighed:
    """An evidence and the weights that it is the mean of.

    Attributes:
      log_evidence: up to the data's constant, as `GradientFit.log_evidence`.
      log_weights: `[draw]`.
      ess: how many draws of the posterior itself these are worth.
      z: `[draw, parameter]`.
      log_density: `[draw]`, of the posterior, up to a constant.
      better: `[parameter]`, z of a draw that is more probable than all fits; None: none is.
    """

    log_evidence: float
    log_weights: Float[np.ndarray, " draw"]
    ess: float
    z: Float[np.ndarray, "draw parameter"]
    log_density: Float[np.ndarray, " draw"]
    better: Float[np.ndarray, " parameter"] | None = None

    @property
    def is_sure(self) -> bool:
        """Whether it is better than Laplace's."""
        return self.ess >= LEAST_ESS


@dataclass(frozen=True)
class _AlongValley:
    """A part of q: a t along a valley; parameters that have none there, from their priors."""

    valley: Valley
    along: np.ndarray  # [parameter], which are moved along the valley
    others: np.ndarray  # indices of the others that the hypothesis has
    width: float

    def draw(self, generator: np.random.Generator, num: int) -> tuple[np.ndarray, np.ndarray]:
        """Points, and their log density in this part."""
        u = student_t(generator, num, self.valley.root.shape[1])
        z = np.array(self.valley(self.width * u))
        z[:, self.others] = generator.standard_normal((num, len(self.others)))
        return z, self._log_density_at(u, z)

    def log_density(self, z: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):  # far off, where it draws none
            u = self.valley.inverse(z, self.along) / self.width
        return self._log_density_at(u, z)

    def _log_density_at(self, u: np.ndarray, z: np.ndarray) -> np.ndarray:
        with np.errstate(over="ignore", invalid="ignore"):
            far = np.nan_to_num(np.sum(u**2, axis=1), nan=np.inf)
        dim, own = u.shape[1], z[:, self.others]
        volume = self.valley.log_volume + dim * np.log(self.width)
        from_priors = -len(self.others) / 2 * np.log(2 * np.pi) - 0.5 * np.sum(own**2, axis=1)
        return log_student_t(far, dim) - volume + from_priors


def weighed(
    fits: Sequence[GradientFit],
    residuals: Residuals,
    seed: int,
    without: GradientFit | None = None,
    num: int = NUM_DRAWS,
    most: int = MOST_DRAWS,
    width: float = 1.0,
    enough: float = ENOUGH_ESS,
    density: Callable[[np.ndarray], np.ndarray] | None = None,
) -> Weighed:
    """The evidence of a hypothesis, and weighed draws of its posterior.

    Args:
      fits: of the hypothesis, the best of each valley.
      residuals: of the trials that were fitted.
      seed: same seed, same evidence.
      without: the fit without its last effect, if there is one.
      num: of draws at once, a rollout each.
      most: of draws in all; more than `num` only while too few of them count.
      width: of the t, in that of the posterior.
      enough: draws of the posterior itself that they must be worth.
      density: of likelihood times exp(-z.z / 2), its logarithm at `[point, parameter]`, up to a
        constant; default: at the sizes of imperfections that were fitted with.
    """
    fit, generator = fits[0], np.random.default_rng([seed, 23])
    density = density or functools.partial(_log_densities, fit, residuals)
    parts, shares = _parts(fits, residuals, width)
    if without is not None and fit.log_evidence < without.log_evidence + HARDLY_BETTER:
        parts.append(_part(without, fit, residuals, width))
        shares = np.append((1 - SHARE_WITHOUT) * shares, SHARE_WITHOUT)
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
    log_evidence = float(logsumexp(made.log_weights) - np.log(len(made.z)))
    return Weighed(log_evidence, made.log_weights, made.ess, made.z, made.log_density, better)


def _parts(
    fits: Sequence[GradientFit], residuals: Residuals, width: float
) -> tuple[list[Part], np.ndarray]:
    """Those of the valleys, and which shares of the draws they have."""
    parts, shares = list[Part](), list[float]()
    for one in fits:
        part = _part(one, fits[0], residuals, width)
        parts.append(part)
        shares.append(1 / len(fits))
        direction = bent_direction(part.valley)
        ridge = None if direction is None else ridge_along(one, part.valley, direction, residuals)
        if ridge is not None:
            parts.append(ridge)
            shares[-1:] = [(1 - SHARE_RIDGE) * shares[-1], SHARE_RIDGE * shares[-1]]
    return parts, np.array(shares)


def _part(one: GradientFit, whose: GradientFit, residuals: Residuals, width: float) -> _AlongValley:
    others = np.flatnonzero(whose.free & ~one.free)
    return _AlongValley(valley_round(one, residuals), one.free, others, width)


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

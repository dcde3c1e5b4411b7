"""The evidence of a hypothesis by importance: Laplace's, mended by a few rollouts round the fit.

    Z = mean of  p(z_i) / q(z_i),    z_i ~ q

Where the posterior is normal, all weights are alike and Z is Laplace's. Where it is skewed, bent or
cut off by the end of a prior, they are not, and their mean is the evidence all the same. How much
they differ says how good it is: the error of log Z is about sqrt(1 / ess - 1 / num).

q has a part for each valley that was found: Student's t along it (`valley.py`), so that valleys add
up and do not count twice where they overlap. Where the hypothesis is hardly better than the one
without its last effect, a quarter of the draws come from there: all else along that one's valley,
the effect's own parameters from their priors. While an effect is too weak to show, its place or its
speed may be anything, and Laplace at the best of them sees nothing of that.

Source: A. B. Owen, Monte Carlo theory, methods and examples (2013), ch. 9 (mixtures); J. Geweke,
Bayesian inference in econometric models using Monte Carlo integration, Econometrica 57 (1989), 1317
(the t).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float
from scipy.special import gammaln, logsumexp

from galileo_jax.inference.fits.evidence import GradientFit
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.joint_problem import NOISE_SD
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

if TYPE_CHECKING:
    from galileo_jax.inference.fits.valley import Valley

NUM_DRAWS, MOST_DRAWS = 256, 1024  # at once, and in all where few of them count
ENOUGH_ESS = 40.0  # the error is a sixth of a nat
LEAST_ESS = 10.0  # of so many the error is a third of a nat; of fewer nobody knows it
BETTER_NATS = 0.5  # by which a draw beats all fits where these are not at their best
DEGREES_OF_FREEDOM = 5.0
SHARE_WITHOUT = 0.25  # of the draws, from the hypothesis without its last effect
HARDLY_BETTER = 10.0  # nats: beyond, an effect too weak to show is e^-10 of the evidence


@dataclass(frozen=True)
class Weighed:
    """An evidence and the weights that it is the mean of.

    Attributes:
      log_evidence: up to the data's constant, as `GradientFit.log_evidence`.
      log_weights: `[draw]`.
      ess: how many draws of the posterior itself these are worth.
      better: `[parameter]`, z of a draw that is more probable than all fits; None: none is.
    """

    log_evidence: float
    log_weights: Float[np.ndarray, " draw"]
    ess: float
    better: Float[np.ndarray, " parameter"] | None = None

    @property
    def is_sure(self) -> bool:
        """Whether it is better than Laplace's."""
        return self.ess >= LEAST_ESS


@dataclass(frozen=True)
class _Part:
    """A part of q: a t along a valley; parameters that have none there, from their priors."""

    valley: "Valley"
    along: np.ndarray  # [parameter], which are moved along the valley
    others: np.ndarray  # indices of the others that the hypothesis has
    width: float

    def draw(self, generator: np.random.Generator, num: int) -> tuple[np.ndarray, np.ndarray]:
        """Points, and their log density in this part."""
        u = generator.standard_normal((num, self.valley.root.shape[1]))
        chi = generator.chisquare(DEGREES_OF_FREEDOM, num) / DEGREES_OF_FREEDOM
        u = u / np.sqrt(chi)[:, None]
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
        nu, dim = DEGREES_OF_FREEDOM, u.shape[1]
        constant = gammaln((nu + dim) / 2) - gammaln(nu / 2) - dim / 2 * np.log(np.pi * nu)
        constant -= self.valley.log_volume + dim * np.log(self.width)
        own = z[:, self.others]
        constant -= len(self.others) / 2 * np.log(2 * np.pi)
        return constant - (nu + dim) / 2 * np.log1p(far / nu) - 0.5 * np.sum(own**2, axis=1)


def weighed(
    fits: Sequence[GradientFit],
    residuals: Residuals,
    seed: int,
    without: GradientFit | None = None,
    num: int = NUM_DRAWS,
    most: int = MOST_DRAWS,
    width: float = 1.0,
) -> Weighed:
    """The evidence of a hypothesis.

    Args:
      fits: of the hypothesis, the best of each valley.
      residuals: of the trials that were fitted.
      seed: same seed, same evidence.
      without: the fit without its last effect, if there is one.
      num: of draws at once, a rollout each.
      most: of draws in all; more than `num` only while too few of them count.
      width: of the t, in that of the posterior.
    """
    fit, generator = fits[0], np.random.default_rng([seed, 23])
    parts = [_part(one, fit, residuals, width) for one in fits]
    shares = np.full(len(parts), 1 / len(parts))
    if without is not None and fit.log_evidence < without.log_evidence + HARDLY_BETTER:
        parts.append(_part(without, fit, residuals, width))
        shares = np.append((1 - SHARE_WITHOUT) * shares, SHARE_WITHOUT)
    counts = np.diff(np.rint(num * np.append(0.0, np.cumsum(shares))).astype(int))
    of = np.repeat(np.arange(len(parts)), counts)
    # The prior's constant; that of the data is the same for all hypotheses.
    constant = np.sum(fit.free) / 2 * np.log(2 * np.pi)
    modes = np.stack([one.z for one in fits])
    best, better, log_weights, ess = -np.inf, None, np.empty(0), 0.0
    while len(log_weights) < num or (ess < ENOUGH_ESS and len(log_weights) < most):
        drawn = [p.draw(generator, n) for p, n in zip(parts, counts, strict=True)]
        z = np.concatenate([own for own, _ in drawn])
        log_parts = np.stack([p.log_density(z) for p in parts])
        # A valley that bends much takes a draw so far that no map finds its way back from there.
        log_parts[of, np.arange(num)] = np.concatenate([density for _, density in drawn])
        log_q = logsumexp(log_parts, axis=0, b=(counts / num)[:, None])
        both = _log_densities(fit, residuals, np.concatenate([z, modes]))
        log_p, of_modes = both[: len(z)], both[len(z) :].max()
        best = max(best, of_modes + BETTER_NATS)
        if log_p.max() > best:
            best, better = float(log_p.max()), z[np.argmax(log_p)]
        log_weights = np.append(log_weights, log_p - constant - log_q)
        total = logsumexp(log_weights)
        ess = float(np.exp(2 * total - logsumexp(2 * log_weights)))
    return Weighed(float(total - np.log(len(log_weights))), log_weights, ess, better)


def _part(one: GradientFit, whose: GradientFit, residuals: Residuals, width: float) -> _Part:
    from galileo_jax.inference.fits.valley import valley_round  # and Equinox, which few calls need

    others = np.flatnonzero(whose.free & ~one.free)
    return _Part(valley_round(one, residuals), one.free, others, width)


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

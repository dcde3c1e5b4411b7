"""Weighed draws of a posterior: rollouts round the fit, each with its weight by importance.

    w_i = p(z_i) / sum_k share_k q_k(z_i),    z_i of any of the q_k

Where the posterior is normal, all weights are alike. Where it is skewed, bent or cut off by the end
of a prior, they are not, and with their weights the draws are of the posterior all the same.

For each valley that was found there is a Student's t along it (`transport_map.py`), so that valleys
add up and do not count twice where they overlap; one that bends too much for that has a second
part, which follows its ridge (`profile_proposal.py`). Half of all draws after the first ones are
from a t that fits those before, a new one each time that these have grown by half; with one after
every batch, each multiplied the errors of rounding of the one before several times. Every draw is
weighed by all that drew.

Source: J. Geweke, Bayesian inference in econometric models using Monte Carlo integration,
Econometrica 57 (1989), 1317 (the t); A. B. Owen, Monte Carlo theory, methods and examples (2013),
ch. 9 (mixtures); J. Cornuet, J.-M. Marin, A. Mira, C. P. Robert, Adaptive multiple importance
sampling, Scand. J. Stat. 39 (2012), 798.
"""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.profile_proposal import BENT, ridge_along
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.fits.t_proposal import Cloud, Points, Proposal, Values
from galileo_jax.inference.fits.transport_map import valley_round
from galileo_jax.inference.resampled import worth

SHARE_ADAPTED = 0.5  # of further draws, from where those before say that the posterior is
GROWN = 1.5  # so many draws as a t fits, and there is a new one
FOLDED = 10 * BENT  # so much bent, a map leads nowhere, and changes with every digit of the fit
SHARE_RIDGE = 0.75  # of a valley's draws, where it bends too much


class WeighedDraws:
    """Draws, and their weights for a density that is told after each batch of them.

    Attributes:
      z: `[draw, parameter]`.
      log_weights: `[draw]`; each by the mixture of all that have drawn.
      log_density: `[draw]`, of what they are weighed for.
      ess: how many draws of the posterior itself these are worth.
    """

    def __init__(
        self,
        proposals: Sequence[Proposal],
        shares: Float[np.ndarray, " proposal"],
        free: Bool[np.ndarray, " parameter"],
    ):
        """`shares`: of the first draws; `free`: the parameters that are drawn."""
        self._proposals, self._shares, self._free = list(proposals), shares, free
        self.z, self.log_weights, self.ess = np.empty((0, len(free))), np.empty(0), 0.0
        self._num_fitted = 0  # draws, by the last t
        self._of, self._own, self.log_density = np.empty(0, int), np.empty(0), np.empty(0)

    def draw(self, generator: np.random.Generator, num: int) -> Points:
        """Further draws."""
        which, shares = np.arange(len(self._shares)), self._shares
        if len(self.z):
            if len(self.z) >= GROWN * self._num_fitted:
                self._proposals.append(Cloud.of(self.z, self.log_weights, self._free))
                self._num_fitted = len(self.z)
            which = np.append(which, len(self._proposals) - 1)
            shares = np.append((1 - SHARE_ADAPTED) * shares, SHARE_ADAPTED)
        counts = np.diff(np.rint(num * np.append(0.0, np.cumsum(shares))).astype(int))
        each = zip(which, counts, strict=True)
        drawn = [self._proposals[k].draw(generator, int(n)) for k, n in each]
        new, own = (np.concatenate(values) for values in zip(*drawn, strict=True))
        self.z = np.concatenate([self.z, new])
        self._own = np.append(self._own, own)
        self._of = np.append(self._of, np.repeat(which, counts))
        return new

    def add(self, log_p: Values) -> None:
        """The log density of the draws made last: all are weighed anew."""
        self.log_density = np.append(self.log_density, log_p)
        log_q = np.stack([one.log_density(self.z) for one in self._proposals])
        # A valley that bends much takes a draw so far that no map finds its way back from there.
        log_q[self._of, np.arange(len(self.z))] = self._own
        shares = np.bincount(self._of, minlength=len(log_q)) / len(self.z)
        mixture = np.asarray(logsumexp(log_q, axis=0, b=shares[:, None]))
        self.log_weights = self.log_density - mixture
        self.ess = worth(self.log_weights)


def weighed(
    fits: Sequence[GradientFit],
    residuals: Residuals,
    seed: int,
    density: Callable[[np.ndarray], np.ndarray],
    num: int,
    most: int,
    enough: float,
) -> WeighedDraws:
    """Weighed draws of the posterior of a hypothesis, `num` at once, a rollout each.

    More than these only until they are worth `enough` draws of the posterior itself, and `most` in
    all. Same seed, same draws.

    `fits`: of the hypothesis, the best of each valley. `residuals`: of the trials that were fitted.
    `density`: its logarithm at `[point, parameter]`, up to a constant.
    """
    proposals, shares = list[Proposal](), list[float]()
    for fit in fits:
        valley = valley_round(fit, residuals)
        proposals.append(valley)
        shares.append(1 / len(fits))
        ridge = ridge_along(fit, valley, residuals)
        if ridge is not None:
            if np.abs(valley.quadratic).max() > FOLDED:
                proposals[-1] = valley.unbent
            proposals.append(ridge)
            shares[-1:] = [(1 - SHARE_RIDGE) * shares[-1], SHARE_RIDGE * shares[-1]]
    made = WeighedDraws(proposals, np.array(shares), fits[0].free)
    generator = np.random.default_rng([seed, 23])
    while len(made.z) < num or (made.ess < enough and len(made.z) < most):
        made.add(density(made.draw(generator, num)))
    return made

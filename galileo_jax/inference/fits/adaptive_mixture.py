"""Importance sampling from a mixture that learns from its own draws where the posterior is.

    w_i = p(z_i) / sum_k share_k q_k(z_i)

The first draws are from the parts that are given. Half of all further ones are from a t that fits
those before (`t_proposal.py`), a new one every time. Every draw is weighed by the mixture of all
that drew.

Source: A. B. Owen, Monte Carlo theory, methods and examples (2013), ch. 9 (mixtures); J. Cornuet,
J.-M. Marin, A. Mira, C. P. Robert, Adaptive multiple importance sampling, Scand. J. Stat. 39
(2012), 798.
"""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from galileo_jax.inference.fits.t_proposal import Cloud

SHARE_ADAPTED = 0.5  # of further draws, from where those before say that the posterior is

Points = Float[np.ndarray, "draw parameter"]
Values = Float[np.ndarray, " draw"]


@runtime_checkable
class Part(Protocol):
    """A distribution of which draws and the density are known."""

    def draw(self, generator: np.random.Generator, num: int) -> tuple[Points, Values]:
        """Points, and their log density."""
        ...

    def log_density(self, z: Points) -> Values:
        """Of points, whoever drew them."""
        ...


class AdaptiveMixture:
    """Draws, and their weights for a density that is told after each batch of them.

    Attributes:
      z: `[draw, parameter]`.
      log_weights: `[draw]`; each by the mixture of all that have drawn.
      log_density: `[draw]`, of what they are weighed for.
      ess: how many draws of the posterior itself these are worth.
    """

    def __init__(
        self,
        parts: Sequence[Part],
        shares: Float[np.ndarray, " part"],
        free: Bool[np.ndarray, " parameter"],
    ):
        """`shares`: of the parts in the first draws; `free`: the parameters that are drawn."""
        self._parts, self._shares, self._free = list(parts), shares, free
        self.z, self.log_weights, self.ess = np.empty((0, len(free))), np.empty(0), 0.0
        self._of, self._own, self.log_density = np.empty(0, int), np.empty(0), np.empty(0)

    def draw(self, generator: np.random.Generator, num: int) -> Points:
        """Further draws."""
        which, shares = np.arange(len(self._shares)), self._shares
        if self.log_density.size:
            which = np.append(which, len(self._parts))
            self._parts.append(Cloud.of(self.z, self.log_weights, self._free))
            shares = np.append((1 - SHARE_ADAPTED) * shares, SHARE_ADAPTED)
        counts = np.diff(np.rint(num * np.append(0.0, np.cumsum(shares))).astype(int))
        drawn = [self._parts[k].draw(generator, int(n)) for k, n in zip(which, counts, strict=True)]
        new, own = (np.concatenate(values) for values in zip(*drawn, strict=True))
        self.z = np.concatenate([self.z, new])
        self._own = np.append(self._own, own)
        self._of = np.append(self._of, np.repeat(which, counts))
        return new

    def add(self, log_p: Values) -> None:
        """The log density of the draws made last: all are weighed anew."""
        self.log_density = np.append(self.log_density, log_p)
        log_parts = np.stack([part.log_density(self.z) for part in self._parts])
        # A valley that bends much takes a draw so far that no map finds its way back from there.
        log_parts[self._of, np.arange(len(self.z))] = self._own
        shares = np.bincount(self._of, minlength=len(log_parts)) / len(self.z)
        self.log_weights = self.log_density - np.asarray(
            logsumexp(log_parts, axis=0, b=shares[:, None])
        )
        weights = np.exp(self.log_weights - self.log_weights.max())
        self.ess = float(weights.sum() ** 2 / np.sum(weights**2))

"""Levenberg and Marquardt's method for tosses that share some parameters and not their starts.

The normal matrix is an arrow: each toss's start is eliminated on its own, which costs as much per
toss for a hundred as for one. Frames that fit badly count less (Student's t, 4 degrees), so that a
toss whose impacts come out in another order does not decide.

Intervals are the sandwich over tosses: what the tosses' own gradients scatter by, whatever the
residuals within a toss have in common.

Source: Triggs et al. (2000), Bundle adjustment, sections 6 and 7; White (1980), A
heteroskedasticity-consistent covariance matrix estimator, Econometrica 48, 817.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.linalg import pinvh

from galileo_jax.runtime import progress
from galileo_jax.runtime.progress import check_cancelled

MAX_STEPS = 10
FREEDOM = 4.0  # of Student's t
SMALLEST_GAIN = 1e-4  # of the loss: a step that gains less is the last
MOST_DAMPED = 1e8

Residuals = Callable[[np.ndarray, np.ndarray], np.ndarray]
Slopes = Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Solution:
    """Where the search ended."""

    common: np.ndarray  # `[common]`, what all share
    own: np.ndarray  # `[toss, 12]`
    covariance: np.ndarray  # `[common, common]`, of the common ones, over tosses
    residuals: np.ndarray  # `[toss, frame, 6]`, whitened; 0 where nothing counts
    has_converged: bool  # whether the last step gained next to nothing


def solve(
    residuals: Residuals,
    slopes: Slopes,
    common: np.ndarray,
    own: np.ndarray,
    prior_sd: np.ndarray,
    own_sd: np.ndarray,
    middle: np.ndarray,
) -> Solution:
    """Searches from `common` `[common]` and `own` `[toss, 12]`.

    `residuals`: whitened, `[toss, frame, 6]`. `slopes`: of these with respect to common and own,
    `[toss, frame, 6, ...]`. The priors are normal: `middle` and `prior_sd` of what is common, 0 and
    `own_sd` of what is not.
    """
    damped, has_converged = 1e-2, False

    def loss_of(left: np.ndarray, common: np.ndarray, own: np.ndarray) -> float:
        square = np.where(np.isfinite(left), left, 1e3) ** 2
        robust = 0.5 * (FREEDOM + 6) * np.sum(np.log1p(square.sum(axis=2) / FREEDOM))
        prior = np.sum(((common - middle) / prior_sd) ** 2)
        return float(robust + 0.5 * prior + 0.5 * np.sum((own / own_sd) ** 2))

    def arrow_at(left: np.ndarray, common: np.ndarray, own: np.ndarray) -> "_Arrow":
        pull, own_pull = (common - middle) / prior_sd**2, own / own_sd**2
        return _Arrow(left, *slopes(common, own), pull, own_pull, prior_sd**-2.0, own_sd**-2.0)

    left = residuals(common, own)
    loss = loss_of(left, common, own)
    for step in range(MAX_STEPS):
        check_cancelled()
        progress.report("fitting", step / MAX_STEPS)
        arrow = arrow_at(left, common, own)
        while True:
            moved, moved_own = arrow.step(damped)
            new, new_own = common + moved, own + moved_own
            left_there = residuals(new, new_own)
            there = loss_of(left_there, new, new_own)
            if there < loss or damped > MOST_DAMPED:
                break
            damped *= 4.0
        gain, damped = loss - there, max(damped / 6.0, 1e-9)
        has_converged = gain < SMALLEST_GAIN * max(min(there, loss), 1.0)
        if gain > 0:
            common, own, left, loss = new, new_own, left_there, there
        if has_converged:
            break
    sandwich = arrow_at(left, common, own).sandwich()
    return Solution(common, own, sandwich, left, has_converged)


class _Arrow:
    """The normal equations of all tosses at one point, of residuals, slopes, priors' pulls."""

    def __init__(
        self,
        left: np.ndarray,
        by_common: np.ndarray,
        by_own: np.ndarray,
        pull: np.ndarray,
        own_pull: np.ndarray,
        prior: np.ndarray,
        own_prior: np.ndarray,
    ):
        count = len(left)
        left = np.where(np.isfinite(left), left, 0.0)
        weight = (FREEDOM + 6) / (FREEDOM + np.sum(left**2, axis=2))
        weight = np.repeat(weight[..., None], 6, axis=2).reshape(count, -1)
        r = left.reshape(count, -1)
        a, b = (
            np.nan_to_num(j, posinf=0.0, neginf=0.0).reshape(count, r.shape[1], -1)
            for j in (by_common, by_own)
        )
        self.aa = np.einsum("nri,nr,nrj->nij", a, weight, a)
        self.ab = np.einsum("nri,nr,nrj->nij", a, weight, b)
        self.bb = np.einsum("nri,nr,nrj->nij", b, weight, b) + np.diag(own_prior)
        self.ga = -np.einsum("nri,nr,nr->ni", a, weight, r)
        self.gb = -np.einsum("nri,nr,nr->ni", b, weight, r) - own_pull
        self.pull, self.prior = pull, prior

    def step(self, damped: float) -> tuple[np.ndarray, np.ndarray]:
        """The damped step of what all share `[common]` and of the starts `[toss, 12]`."""
        solved = self._starts_solved(damped)
        whole = self.aa.sum(axis=0) + np.diag(self.prior)
        matrix = whole + damped * np.diag(np.diag(whole))
        matrix = matrix - np.sum(self.ab @ solved[..., :-1], axis=0)
        right = self.ga.sum(axis=0) - self.pull - np.sum(self.ab @ solved[..., -1:], axis=0)[:, 0]
        moved = np.linalg.solve(matrix, right)
        return moved, solved[..., -1] - solved[..., :-1] @ moved

    def _starts_solved(self, damped: float) -> np.ndarray:
        """Each toss's start by what is common, and by its own pull in the last column."""
        own = self.bb + damped * np.eye(self.bb.shape[-1]) * self.bb
        return np.linalg.solve(own, np.concatenate([self.ab.mT, self.gb[..., None]], axis=2))

    def sandwich(self) -> np.ndarray:
        """The covariance of what all share, from the scatter of the tosses' gradients."""
        solved = self._starts_solved(0.0)
        each = self.aa - self.ab @ solved[..., :-1]
        bread = pinvh(each.sum(axis=0) + np.diag(self.prior))
        scores = self.ga - (self.ab @ solved[..., -1:])[..., 0]
        count = len(scores)
        meat = scores.T @ scores * count / max(count - 1, 1)
        meat = meat + np.diag(self.prior)
        return bread @ meat @ bread

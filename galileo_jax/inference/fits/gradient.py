"""Descents of the gradient fit: many starts and hypotheses at once, to a mode of the posterior.

    search   Levenberg-Marquardt (`descent.py`) on  [ C^-1/2 (observed - predicted(z)) ; z ],  the
             prior being the second block, at more noise than the clip's
    polish   the same with fitted noise scales, until a new round gains nothing (`descent.py`)
    fit      the normal approximation in z, with covariance (J^T J + 1)^-1; evidence by Laplace
             (`laplace.py`)

Where they start, and which ends are followed, is not decided here: `galileo_jax.search`.

Compiled code (`kernels.py`) contains no rollout. JAX can therefore cache it for every engine, and
all clips share it; clips differ only in the data they pass in. Which optimiser, and why:
docs/explanation/optimiser.md.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.inference.fits.descent import BEHIND as BEHIND
from galileo_jax.inference.fits.descent import (
    BEHIND_IN_SEARCH,
    SAME_VALLEY_NATS,
    Descended,
    Descent,
    GiveUp,
    polish,
)
from galileo_jax.inference.fits.laplace import Code as Code
from galileo_jax.inference.fits.laplace import GradientFit as GradientFit
from galileo_jax.inference.fits.laplace import laplace_fits, points_of
from galileo_jax.inference.fits.residuals import Batch, Residuals, Sides
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE, JointProblem, noise_explains
from galileo_jax.runtime.batching import side_by_side

MANY = 64  # points of a usual batch
# Noise on the way to a fit, metres: a camera that sees hundredths of a millimetre makes valleys too
# narrow to be met by scattered starts.
SEARCH_SD_M = 0.001
ENOUGH_NATS = 0.1  # the search stops where a step promises to lower chi2 / 2 by less
# Steps of a search from one start; of a race, from which the polish takes stragglers on; of a round
# with fitted noise scales.
MOST_STEPS, MOST_RACE_STEPS, MOST_POLISH_STEPS = 80, 20, 80
# Converged where a new round with fitted noise scales lowers chi2 / 2 by no more: two starts then
# agree within some hundredths of an sd. MuJoCo's contacts are no smoother than the second; of many
# hypotheses no verdict will hang on most.
SETTLED_NATS, SETTLED_IF_ROUGH_NATS, SETTLED_IN_TURN_NATS = 0.05, 0.5, 0.3
STILL = 1e-5  # standard deviations, and of a noise scale: a fit that moves on by less stands still
STILL_NATS = STILL**2
MOST_ADDED, ADDS_NATS = 3, 3.0  # valleys whose evidence adds up, unless so far behind the best
OUT_OF_THE_RACE = 60.0  # hypotheses, in the same: far more than any rule of a verdict looks at
# What a fit that has come to rest says of itself, well or ill.
SETTLED = (Code.CONVERGED, Code.MISFIT)


class GradientFitter:
    """Descends on the residuals of trials, for any hypotheses.

    Of arguments `z` and `free` (`JointProblem.free`) are `[point, model parameter]`, and `owner`
    `[point]` is which hypothesis each point belongs to, from 0. It `is_smooth` where motion is so
    at every scale, as the rigid engine's is.
    """

    def __init__(self, trials: JointProblem, settled_nats: float = SETTLED_NATS):
        """`settled_nats`: by less a last round lowers chi2 / 2, where motion is smooth."""
        self.trials, self.residuals = trials, Residuals(trials)
        self._settled_nats = settled_nats
        self.is_smooth = trials.problems[0].engine.name == "rigid"
        self._count = len(trials.model_parameters)

    def _descent(self, sides: Sides = "ahead") -> Descent:
        sides = sides if self.is_smooth else "both"
        return Descent(self.residuals, self.trials.coarse_steps, self.is_smooth, sides)

    def compile(self, with_races: bool = False) -> None:
        """Compiles (or reads from the cache) all parts, so that fits only compute.

        `with_races`: what many hypotheses at once need, too.
        """
        one, many = (np.zeros((n, self._count)) for n in (1, MANY))
        descent, parts = self._descent(), list[Callable[[], Any]]()
        if with_races:
            free = self.trials.free(self.trials.all_effects)[: self._count]
            parts.append(functools.partial(descent, self._batch(many, free), np.inf, 1))
        for effects in dict.fromkeys([(), self.trials.all_effects]):
            free = self.trials.free(effects)[: self._count]
            parts.append(functools.partial(descent, self._batch(one, free), np.inf, 1))
            parts.append(functools.partial(self.search_costs, many, free))
        if self.is_smooth:
            side_by_side(parts)
        else:  # MuJoCo's engines keep one set of simulations for all batches of a size
            for part in parts:
                part()

    def fit_from(
        self,
        z: Float[np.ndarray, "point parameter"],
        free: Bool[np.ndarray, "point parameter"],
        owner: Int[np.ndarray, " point"],
    ) -> list[GradientFit]:
        """Fits of several hypotheses at once, each from one or more starts: of its best one."""
        points, give_up = self._batch(z, free), GiveUp(owner, BEHIND_IN_SEARCH)
        found = self._descent()(points, ENOUGH_NATS, MOST_STEPS, give_up)
        first = np.lexsort([found.best.cost, owner])
        best = first[np.unique(owner[first], return_index=True)[1]]
        ends = points._replace(z=found.best.z).take(best)
        return list(self._polish(ends, np.arange(len(best)))[0].values())

    def race(
        self,
        z: Float[np.ndarray, "point parameter"],
        free: Bool[np.ndarray, "point parameter"],
        owner: Int[np.ndarray, " point"],
        lowest: float = np.inf,
    ) -> Descended:
        """Searches for several hypotheses at once, as long as each may still win.

        A start stops where it joins a better one of its hypothesis, or is far behind: of its
        hypothesis, or of the best of all, `lowest` (nats) among these. Costs are those at the
        search's noise, which is no less than the clip's: who is far behind by them is farther
        behind by the clip's own.
        """
        give_up = GiveUp(owner, BEHIND_IN_SEARCH, 0.0, OUT_OF_THE_RACE, lowest)
        return self._descent()(self._batch(z, free), ENOUGH_NATS, MOST_RACE_STEPS, give_up)

    def polish(
        self,
        z: Float[np.ndarray, "point parameter"],
        free: Bool[np.ndarray, "point parameter"],
        owner: Int[np.ndarray, " point"],
    ) -> dict[int, GradientFit]:
        """Fits from where a search ended, one for each valley, by the row of where it came from."""
        return self._polish(self._batch(z, free), owner)[0]

    def polish_in_turn(
        self,
        z: Float[np.ndarray, "point parameter"],
        free: Bool[np.ndarray, "point parameter"],
        parts: Sequence[np.ndarray],
    ) -> Iterator[tuple[int, GradientFit]]:
        """Fits of hypotheses, one point of each, roughly; `parts`: indices, one after the other.

        Those far behind what an earlier part came to are left where they are.
        """
        lowest = np.inf
        for own in parts:
            points, owner = self._batch(z[own], free[own]), np.arange(len(own))
            fits, lowest = self._polish(points, owner, lowest, SETTLED_IN_TURN_NATS)
            for row, fit in fits.items():
                yield int(own[row]), fit

    def search_costs(self, z: np.ndarray, free: np.ndarray) -> Float[np.ndarray, " point"]:
        """chi2 / 2 and the prior's part at the search's noise: to choose starts."""
        return self.residuals.costs(self._batch(z, free))

    def is_explained(self, fit: GradientFit, noise_scale: float = 1.0) -> bool:
        """Whether `noise_explains` what it leaves."""
        data = [clip.whitening for clip in self.residuals.clips]
        degrees = sum(float(own.degrees(1.0)) for own in data)
        return noise_explains(fit.chi2, degrees - fit.num_used, noise_scale)

    def continued(self, fit: GradientFit, to_rest: bool = True) -> GradientFit:
        """A fit of other sizes of imperfections, gone on from, with the valleys beside it.

        `fit`: with the sizes of before. `to_rest`: whether it goes on until it stands still.
        """
        points = points_of((fit, *fit.beside))
        ends = list(self._polish(points, np.zeros(len(points.z), int))[0].values())
        found = self.at_rest(ends) if to_rest else _with_beside(ends)
        if found.code is Code.CONVERGED and not self.is_explained(found, NOISE_SCALE_RANGE[1]):
            return replace(found, code=Code.MISFIT)
        return found

    def at_rest(self, found: Sequence[GradientFit]) -> GradientFit:
        """The most evident fit and those of other valleys that count beside it, standing still.

        What is left of the way to a fit would be, through the curvature of the misfit, a
        difference between processors, seeds and versions.
        """
        fit = _with_beside(found)
        if not self.is_smooth or fit.code is not Code.CONVERGED:
            return fit
        points, descent = points_of((fit, *fit.beside)), self._descent("both")
        owner = np.arange(len(points.z))
        modes = polish(descent, points, owner, STILL_NATS, MOST_POLISH_STEPS, drift=STILL)
        still = laplace_fits(self.trials, self.residuals, modes)
        return _with_beside([replace(one, code=Code.CONVERGED) for one in still])

    def _batch(self, z: np.ndarray, free: np.ndarray) -> Batch:
        free = np.broadcast_to(free, z.shape)
        noise = [clip.search_noise(SEARCH_SD_M) for clip in self.residuals.clips]
        return Batch(np.where(free, z, 0.0), free, np.tile(noise, (len(z), 1)))

    def _polish(
        self, points: Batch, owner: np.ndarray, lowest: float = np.inf, settled: float | None = None
    ) -> tuple[dict[int, GradientFit], float]:
        """Fits by the row of the point from which each came, and the least cost.

        Who joined another has none; `lowest`: the least cost of others.
        """
        settled = (settled or self._settled_nats) if self.is_smooth else SETTLED_IF_ROUGH_NATS
        found = polish(self._descent(), points, owner, settled, MOST_POLISH_STEPS, lowest)
        fits = laplace_fits(self.trials, self.residuals, found)
        return dict(zip(found.rows.tolist(), fits, strict=True)), found.lowest


def _with_beside(fits: Sequence[GradientFit]) -> GradientFit:
    """The most evident fit, with those of other valleys that count beside it."""
    best = max(fits, key=lambda fit: fit.log_evidence)
    sound = [fit for fit in fits if fit.code is Code.CONVERGED and fit is not best]
    _, *others = apart([best, *sound])
    return replace(best, beside=tuple(others))


def apart(fits: Sequence[GradientFit]) -> list[GradientFit]:
    """The best fit, and those of other valleys that add to its evidence, best first."""
    left, found = sorted(fits, key=lambda fit: -fit.log_evidence), list[GradientFit]()
    least = left[0].log_evidence - ADDS_NATS
    while left and len(found) < MOST_ADDED:
        first, *left = left
        found.append(first)
        inverse = np.linalg.pinv(first.covariance, hermitian=True)
        steps = [fit.z - first.z for fit in left]
        is_far = [0.5 * step @ inverse @ step >= SAME_VALLEY_NATS for step in steps]
        each = zip(left, is_far, strict=True)
        left = [fit for fit, far in each if far and fit.log_evidence > least]
    return found

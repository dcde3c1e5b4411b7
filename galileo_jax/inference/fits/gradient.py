"""Descents of the gradient fit: many starts and hypotheses at once, to a mode of the posterior.

    search   Levenberg-Marquardt (`descent.py`) on  [ C^-1/2 (observed - predicted(z)) ; z ],  the
             prior being the second block, at more noise than the clip's
    polish   the same with fitted noise scales, until a new round gains nothing (`refine.py`)
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

from galileo_jax.inference.fits.descent import BEHIND_IN_SEARCH, Descended, Descent, GiveUp
from galileo_jax.inference.fits.distinct_modes import apart
from galileo_jax.inference.fits.laplace import Code as Code
from galileo_jax.inference.fits.laplace import GradientFit as GradientFit
from galileo_jax.inference.fits.laplace import laplace_fits, points_of
from galileo_jax.inference.fits.refine import BEHIND as BEHIND
from galileo_jax.inference.fits.refine import polish
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.joint_problem import (
    NOISE_SCALE_RANGE,
    JointProblem,
    noise_explains,
)
from galileo_jax.runtime.batching import side_by_side
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

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
OUT_OF_THE_RACE = 60.0  # hypotheses, in the same: far more than any rule of a verdict looks at
# What a fit that has come to rest says of itself, well or ill.
SETTLED = (Code.CONVERGED, Code.MISFIT)


class GradientFitter:
    """Descends on the residuals of trials, for any hypotheses."""

    def __init__(self, trials: JointProblem, settled_nats: float = SETTLED_NATS):
        """`settled_nats`: by less a last round lowers chi2 / 2, where motion is smooth."""
        self.trials = trials
        is_smooth = trials.problems[0].engine.name == "rigid"
        self._descent = Descent(Residuals(trials), trials.coarse_steps, is_smooth, not is_smooth)
        self._residuals = self._descent.residuals
        self._count = len(trials.model_parameters)
        self._settled = settled_nats if is_smooth else SETTLED_IF_ROUGH_NATS

    @property
    def residuals(self) -> Residuals:
        """Of the trials."""
        return self._residuals

    @property
    def is_smooth(self) -> bool:
        """Whether motion is smooth at every scale, as the rigid engine's is."""
        return self._descent.is_smooth

    def compile(self, with_races: bool = False) -> None:
        """Compiles (or reads from the cache) all parts, so that `fit` only computes.

        Args:
          with_races: what many hypotheses at once need, too.
        """
        one, many = (np.zeros((n, self._count)) for n in (1, MANY))
        parts: list[Callable[[], Any]] = []
        if with_races:
            free = self.trials.free(self.trials.all_effects)[: self._count]
            parts.append(functools.partial(self._descent, self._batch(many, free), np.inf, 1))
        for effects in dict.fromkeys([(), self.trials.all_effects]):
            free = self.trials.free(effects)[: self._count]
            parts.append(functools.partial(self._descent, self._batch(one, free), np.inf, 1))
            parts.append(functools.partial(self._residuals.costs, self._batch(many, free)))
        if self.is_smooth:
            side_by_side(parts)
        else:  # MuJoCo's engines keep one set of simulations for all batches of a size
            for part in parts:
                part()

    def continued(self, fit: GradientFit, to_rest: bool = True) -> GradientFit:
        """A fit of other sizes of imperfections, gone on from, with the valleys beside it.

        Args:
          fit: with the sizes of before.
          to_rest: whether it goes on until it stands still.
        """
        points = points_of((fit, *fit.beside))
        ends = list(self._polish(points, np.zeros(len(points.z), int))[0].values())
        found = self.at_rest(ends) if to_rest else _with_beside(ends)
        if found.code is Code.CONVERGED and not self.is_explained(found, NOISE_SCALE_RANGE[1]):
            return replace(found, code=Code.MISFIT)
        return found

    def fit_from(
        self,
        starts: Float[np.ndarray, "start parameter"],
        free: Bool[np.ndarray, "start parameter"],
        owner: Int[np.ndarray, " start"],
    ) -> list[GradientFit]:
        """Fits several hypotheses at once, each from one or more starts.

        Args:
          starts: `[start, model parameter]`, z.
          free: `[start, model parameter]`, see `JointProblem.free`.
          owner: `[start]`, which hypothesis each belongs to, ascending from 0.

        Returns:
          One fit per hypothesis, of its best start.
        """
        points = self._batch(starts, free)
        give_up = GiveUp(owner, BEHIND_IN_SEARCH)
        found = self._descent(points, ENOUGH_NATS, MOST_STEPS, give_up)
        best = []
        for hypothesis in range(int(owner.max()) + 1):
            own = np.flatnonzero(owner == hypothesis)
            best.append(own[np.argmin(found.best.cost[own])])
        ends = points._replace(z=found.best.z).take(np.array(best))
        return list(self._polish(ends, np.arange(len(best)))[0].values())

    def race(
        self,
        starts: Float[np.ndarray, "start parameter"],
        free: Bool[np.ndarray, "start parameter"],
        owner: Int[np.ndarray, " start"],
        lowest: float = np.inf,
    ) -> Descended:
        """Searches for several hypotheses at once, as long as each may still win.

        A start stops where it joins a better one of its hypothesis, or is far behind: of its
        hypothesis, or of the best of all. Costs are those at the search's noise, which is no less
        than the clip's: who is far behind by them is farther behind by the clip's own.

        Args:
          starts: `[start, model parameter]`, z.
          free: `[start, model parameter]`, see `JointProblem.free`.
          owner: `[start]`, which hypothesis each belongs to.
          lowest: cost that others have already come to, nats.
        """
        give_up = GiveUp(owner, BEHIND_IN_SEARCH, 0.0, OUT_OF_THE_RACE, lowest)
        return self._descent(self._batch(starts, free), ENOUGH_NATS, MOST_RACE_STEPS, give_up)

    def polish(
        self,
        z: Float[np.ndarray, "point parameter"],
        free: Bool[np.ndarray, "point parameter"],
        owner: Int[np.ndarray, " point"],
    ) -> dict[int, GradientFit]:
        """Fits from where a search ended, one fit for each valley of each hypothesis.

        Args:
          z: `[point, model parameter]`.
          free: `[point, model parameter]`.
          owner: `[point]`, which hypothesis each belongs to.

        Returns:
          By the index of the point from which it came.
        """
        return self._polish(self._batch(z, free), owner)[0]

    def polish_in_turn(
        self,
        z: Float[np.ndarray, "hypothesis parameter"],
        free: Bool[np.ndarray, "hypothesis parameter"],
        parts: Sequence[np.ndarray],
    ) -> Iterator[tuple[int, GradientFit]]:
        """Fits one end of each of several hypotheses, part by part of them, roughly.

        Those far behind what an earlier part came to are left where they are.

        Args:
          z: `[hypothesis, model parameter]`.
          free: `[hypothesis, model parameter]`.
          parts: indices of hypotheses.
        """
        lowest, settled = np.inf, max(self._settled, SETTLED_IN_TURN_NATS)
        for own in parts:
            points = self._batch(z[own], free[own])
            fits, lowest = self._polish(points, np.arange(len(own)), lowest, settled)
            for row, fit in fits.items():
                yield int(own[row]), fit

    def costs_beside(
        self, fit: GradientFit, z: Float[np.ndarray, "point parameter"]
    ) -> Float[np.ndarray, " point"]:
        """chi2 / 2 and the prior's part of other points, with a fit's own noise and parameters."""
        return self._residuals.costs(fit.points(z))

    def search_costs(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """chi2 / 2 and the prior's part at the search's noise, `[point]`: to choose starts."""
        return self._residuals.costs(self._batch(z, free))

    def is_explained(self, fit: GradientFit, noise_scale: float = 1.0) -> bool:
        """Whether `noise_explains` what it leaves."""
        degrees = sum(
            float(GaussianLikelihood.degrees(1.0, clip.data.whitening))
            for clip in self._residuals.clips
        )
        return noise_explains(fit.chi2, degrees - fit.num_used, noise_scale)

    def at_rest(self, found: Sequence[GradientFit]) -> GradientFit:
        """The most evident fit and those of other valleys that count beside it, standing still.

        What is left of the way to a fit would be, through the curvature of the misfit, a
        difference between processors, seeds and versions.
        """
        fit = _with_beside(found)
        if not self.is_smooth or fit.code is not Code.CONVERGED:
            return fit
        points = points_of((fit, *fit.beside))
        descent, owner = replace(self._descent, is_central=True), np.arange(len(points.z))
        modes = polish(descent, points, owner, STILL_NATS, MOST_POLISH_STEPS, drift=STILL)
        still = laplace_fits(self.trials, self._residuals, modes)
        return _with_beside([replace(one, code=Code.CONVERGED) for one in still])

    def _batch(self, z: np.ndarray, free: np.ndarray) -> Batch:
        free = np.broadcast_to(free, z.shape)
        noise = np.tile(
            [clip.search_noise(SEARCH_SD_M) for clip in self._residuals.clips],
            (len(z), 1),
        )
        return Batch(np.where(free, z, 0.0), free, noise)

    def _polish(
        self,
        points: Batch,
        owner: np.ndarray,
        lowest: float = np.inf,
        settled: float | None = None,
    ) -> tuple[dict[int, GradientFit], float]:
        """Fits by the row of the point from which each came, and the least cost.

        Who joined another has none; `lowest`: the least cost of others.
        """
        settled = settled or self._settled
        found = polish(self._descent, points, owner, settled, MOST_POLISH_STEPS, lowest)
        fits = laplace_fits(self.trials, self._residuals, found)
        return dict(zip(found.rows.tolist(), fits, strict=True)), found.lowest


def _with_beside(fits: Sequence[GradientFit]) -> GradientFit:
    """The most evident fit, with those of other valleys that count beside it."""
    best = max(fits, key=lambda fit: fit.log_evidence)
    sound = [fit for fit in fits if fit.code is Code.CONVERGED and fit is not best]
    _, *others = apart([best, *sound])
    return replace(best, beside=tuple(others))

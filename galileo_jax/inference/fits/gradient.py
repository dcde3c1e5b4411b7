"""The gradient fit: Levenberg-Marquardt from many starts, for many hypotheses at once.

    1. Roll out `num_starts` scattered parameter vectors in one batch; keep the best few.
    2. Levenberg-Marquardt (`descent.py`) on  [ C^-1/2 (observed - predicted(z)) ; z ],  the prior
       being the second block, for all starts (and, in a diagnosis, all hypotheses) in one batch.
    3. The same with fitted noise scales, until a new round gains nothing (`polish.py`).
    4. Posterior: normal in z with covariance (J^T J + 1)^-1; evidence by Laplace (`evidence.py`).

Compiled code (`programs.py`) contains no rollout. JAX can therefore cache it for every engine, and
all clips share it; clips differ only in the data they pass in. From a single distant starting point
the search usually ends in a local optimum, because the time of the collision decides which frames
are compared; scattered starting points cost only one batch. Which optimiser, and why:
docs/explanation/optimiser.md.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from scipy.stats import chi2

from galileo_jax.inference.fits.descent import Descended, Descent, GiveUp
from galileo_jax.inference.fits.evidence import Code as Code
from galileo_jax.inference.fits.evidence import GradientFit as GradientFit
from galileo_jax.inference.fits.evidence import laplace_fits
from galileo_jax.inference.fits.polish import BEHIND as BEHIND
from galileo_jax.inference.fits.polish import polish
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.fits.starts import absent_z, scattered_round, scattered_starts
from galileo_jax.inference.fits.stages import before_moving
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import inverse
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

VARIANTS_Z = (-1.0, 0.5, 2.0)  # of positive nuisances, tried from every fit
BEHIND_IN_SEARCH = 20.0  # starts of one hypothesis, in nats of the search's coarse noise

CHANCE, SECOND_STARTS, SECOND_REFINED, TRIED, UNKNOWN_SD = 1e-3, 128, 16, 4, 0.5


def _apart(ends, num):
    """Those of different cost, best first."""
    order = np.argsort(ends.cost)
    kept = []
    for i in order:
        if all(ends.cost[i] - ends.cost[j] > 0.5 for j in kept) and ends.cost[i] < ends.cost[order[0]] + BEHIND_IN_SEARCH:
            kept.append(i)
    return np.array(kept[:num])


@dataclass(frozen=True)
class Settings:
    """How hard to search.

    Attributes:
      num_starts: scattered parameter vectors.
      num_refined: of these, how many are refined.
      search_sd_m: noise assumed on the way to the fit: a camera that sees hundredths of a
        millimetre makes valleys too narrow to be met by scattered starts.
      max_steps: of Levenberg-Marquardt from one start.
      max_polish_steps: in a round with fitted noise scales.
      enough: the search stops where a step promises to lower chi2 / 2 by less.
      settled: converged where a new round with fitted noise scales lowers chi2 / 2 by no more.
        Two starts then agree within some hundredths of an sd.
      settled_if_rough: the same with MuJoCo's contacts, whose chi2 is no smoother than that.
    """

    num_starts: int = 64
    num_refined: int = 4
    search_sd_m: float = 0.001
    max_polish_steps: int = 80
    max_steps: int = 80
    enough: float = 0.1
    settled: float = 0.05
    settled_if_rough: float = 0.5


class GradientFitter:
    """Fits trials; `fit` may be called for many seeds and hypotheses."""

    def __init__(self, trials: JointProblem, settings: Settings = Settings()):
        self.trials, self.settings = trials, settings
        is_smooth = trials.problems[0].engine.name == "rigid"
        self._descent = Descent(Residuals(trials), trials.coarse_steps, is_smooth)
        self._residuals = self._descent.residuals
        self._count = len(trials.model_parameters)
        self._settled = settings.settled if is_smooth else settings.settled_if_rough
        parameters = trials.model_parameters
        is_nuisance = np.array([p.role == "nuisance" for p in parameters])
        zero = np.array(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
        self._is_positive_nuisance = is_nuisance & ~np.isfinite(zero)

    def compile(self) -> None:
        """Compiles (or reads from the cache) all parts, so that `fit` only computes."""
        free = self.trials.free(self.trials.all_effects)[: self._count]
        self._descent(self._batch(np.zeros((1, self._count)), free), np.inf, 1)
        self._residuals.costs(self._batch(np.zeros((self.settings.num_starts, self._count)), free))

    def fit(
        self,
        seed: int,
        on_stage: Callable[[str], None] = lambda _: None,
        effects: Sequence[str] | None = None,
    ) -> GradientFit:
        """Fits from scattered starts; the same seed gives the same result.

        Args:
          seed: of the starts.
          on_stage: told what is being done.
          effects: names of the effects that are there; default: all of the models'.
        """
        self._residuals.num_rollouts = 0
        effects = self.trials.all_effects if effects is None else effects
        free = self.trials.free(effects)[: self._count]
        on_stage("searching")
        scattered = scattered_starts(self.trials, free, self.settings.num_starts, seed)
        fit = self._best_of(scattered, free, self.settings.num_refined, on_stage)
        if self._is_explained(fit):
            return fit
        on_stage("searching on")
        starts = np.concatenate([
            self._by_stages(free, seed),
            scattered_starts(self.trials, free, SECOND_STARTS, seed + 1),
        ])
        other = self._best_of(starts, free, SECOND_REFINED, on_stage)
        fit = max(fit, other, key=lambda one: one.log_evidence)
        if not self._is_explained(fit) and fit.code is Code.CONVERGED:
            fit = replace(fit, code=Code.MISFIT)
        return fit

    def _best_of(self, starts, free, num, on_stage) -> GradientFit:
        """From the best starts."""
        points = self._batch(starts, free)
        best = np.argsort(self._residuals.costs(points))[:num]
        found = self._search(points.take(best), np.zeros(len(best), int))
        on_stage("refining")
        ends = _apart(found.best, TRIED)
        fits = self._polish(self._batch(found.best.z[ends], free), found.num_steps)
        fit = max(fits, key=lambda one: one.log_evidence)
        return self._best_variant(fit.z[:self._count], free, found.num_steps)

    def _is_explained(self, fit: GradientFit) -> bool:
        degrees = sum(float(GaussianLikelihood.degrees(1.0, c.data.whitening)) for c in self._residuals.clips)
        return bool(chi2.sf(fit.chi2, max(degrees - fit.num_used, 1.0)) > CHANCE)

    def _by_stages(self, free, seed):
        centres, unknown = absent_z(self.trials)[None], None
        is_main = free & np.array([p.role != "nuisance" for p in self.trials.model_parameters])
        unknown = is_main[None]
        for index in range(1, max(len(p.observation.names) for p in self.trials.problems)):
            short = before_moving(self.trials, index)
            if short is None:
                continue
            fitter = GradientFitter(short, self.settings)
            points = fitter._batch(
                scattered_round(self.trials, centres, unknown, self.settings.num_starts, seed), free)
            best = np.argsort(fitter._residuals.costs(points))[:self.settings.num_refined]
            found = fitter._search(points.take(best), np.zeros(len(best), int))
            self._residuals.num_rollouts += fitter._residuals.num_rollouts
            ends = _apart(found.best, TRIED)
            centres = found.best.z[ends]
            variance = np.diagonal(np.linalg.inv(found.best.normal[ends]), axis1=1, axis2=2)
            unknown = is_main & (variance > UNKNOWN_SD ** 2)
        if not unknown.any():
            return centres
        return scattered_round(self.trials, centres, unknown, SECOND_STARTS, seed)

    def refit(self, fit: GradientFit) -> GradientFit:
        """Fits again from a fit, with its positive nuisances moved: the better of both."""
        self._residuals.num_rollouts = 0
        count = self._count
        return self._best_variant(fit.z[:count], fit.free[:count], 0)

    def fit_from(
        self, starts: np.ndarray, free: np.ndarray, owner: np.ndarray
    ) -> list[GradientFit]:
        """Fits several hypotheses at once, each from one or more starts.

        Args:
          starts: `[start, model parameter]`, z.
          free: `[start, model parameter]`, see `JointProblem.free`.
          owner: `[start]`, which hypothesis each belongs to, ascending from 0.

        Returns:
          One fit per hypothesis, of its best start.
        """
        self._residuals.num_rollouts = 0
        points = self._batch(starts, free)
        found = self._search(points, owner)
        best = []
        for hypothesis in range(int(owner.max()) + 1):
            own = np.flatnonzero(owner == hypothesis)
            best.append(own[np.argmin(found.best.cost[own])])
        ends = points._replace(z=found.best.z).take(np.array(best))
        return self._polish(ends, found.num_steps)

    def search_costs(self, z: np.ndarray, free: np.ndarray) -> np.ndarray:
        """chi2 / 2 and the prior's part at the search's noise, `[point]`: to choose starts."""
        return self._residuals.costs(self._batch(z, free))

    def _best_variant(self, z: np.ndarray, free: np.ndarray, num_steps: int) -> GradientFit:
        """Polishes z and variants of it; the most evident fit.

        A small coefficient of restitution decides whether bodies part and meet again, so that
        the misfit has a valley on either side.
        """
        positive = self._is_positive_nuisance & free
        variants = [z]
        if positive.any():
            variants += [np.where(positive, other, z) for other in VARIANTS_Z]
        fits = self._polish(self._batch(np.stack(variants), free), num_steps)
        return max(fits, key=lambda fit: fit.log_evidence)

    def _batch(self, z: np.ndarray, free: np.ndarray) -> Batch:
        free = np.broadcast_to(free, z.shape)
        noise = np.tile(
            [clip.search_noise(self.settings.search_sd_m) for clip in self._residuals.clips],
            (len(z), 1),
        )
        return Batch(np.where(free, z, 0.0), free, noise)

    def _search(self, points: Batch, owner: np.ndarray) -> Descended:
        """Of points with the same owner, those far behind are given up."""
        settings = self.settings
        give_up = GiveUp(owner, BEHIND_IN_SEARCH)
        return self._descent(points, settings.enough, settings.max_steps, give_up)

    def _polish(self, points: Batch, num_steps: int) -> list[GradientFit]:
        found = polish(self._descent, points, self._settled, self.settings.max_polish_steps)
        stats: dict[str, float] = {"num_steps": num_steps + found.num_steps}
        return laplace_fits(self.trials, self._residuals, found, stats)

"""The gradient fit: Levenberg-Marquardt from many starts, for many hypotheses at once.

    1. Roll out `num_starts` scattered parameter vectors in one batch; keep the best few.
    2. Levenberg-Marquardt (`descent.py`) on  [ C^-1/2 (observed - predicted(z)) ; z ],  the prior
       being the second block, for all starts (and, in a diagnosis, all hypotheses) in one batch.
    3. The same with fitted noise scales, until a new round gains nothing (`refine.py`).
    4. Where noise does not explain what is left, or the refined starts disagree, a second search,
       phase by phase (`incremental_shooting.py`), from more starts, and round what has been found.
    5. Where points round the fit say that the posterior is elsewhere, it goes on from these
       (`posterior_check.py`).
    6. The normal approximation in z, with covariance (J^T J + 1)^-1; evidence by Laplace
       (`laplace.py`).

Compiled code (`kernels.py`) contains no rollout. JAX can therefore cache it for every engine, and
all clips share it; clips differ only in the data they pass in. From a single distant starting point
the search usually ends in a local optimum, because the time of the collision decides which frames
are compared; scattered starting points cost only one batch. Which optimiser, and why:
docs/explanation/optimiser.md.
"""

import functools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from galileo_jax.inference.fits.descent import Descended, Descent, GiveUp
from galileo_jax.inference.fits.distinct_modes import apart
from galileo_jax.inference.fits.incremental_shooting import phases
from galileo_jax.inference.fits.laplace import Code as Code
from galileo_jax.inference.fits.laplace import GradientFit as GradientFit
from galileo_jax.inference.fits.laplace import laplace_fits
from galileo_jax.inference.fits.normal_matrix import inverse
from galileo_jax.inference.fits.posterior_check import to_go_on_from
from galileo_jax.inference.fits.refine import BEHIND as BEHIND
from galileo_jax.inference.fits.refine import polish
from galileo_jax.inference.fits.residuals import Batch, Residuals
from galileo_jax.inference.fits.search_results import BEHIND_IN_SEARCH, Ends
from galileo_jax.inference.fits.starts import absent_z, scattered_round, scattered_starts
from galileo_jax.inference.joint_problem import (
    NOISE_SCALE_RANGE,
    NOISE_SD,
    JointProblem,
    noise_explains,
)
from galileo_jax.runtime.batching import side_by_side
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

ELSEWHERE_Z = (-2.0, -1.0, 1.0, 2.0)  # of what a fit leaves open: elsewhere it may show
FAR_SDS = 8.0  # from a fit that tells a parameter: there it should be far worse (32 nats)
UNTOLD_SD_Z = 0.9  # of the prior's 1: a parameter left so open does not show
VARIANTS_Z = (-2.0, -0.5, 1.0)  # of positive nuisances: hardly any, a little, a lot; from every fit
CROSSED_Z = (-3.0, 1.0)  # one of them next to nothing, the others a lot
MOVED_Z = (-1.0, -0.5, 0.5, 1.0)  # one parameter of an end, to come to the valleys beside it
ALONG_Z = np.linspace(-2.0, 2.5, 19)  # of a positive nuisance: where another valley may begin
LEADS_ON = 1.0  # nats: less is no other valley
STILL = 1e-5  # standard deviations, and of a noise scale: a fit that moves on by less stands still
STILL_NATS = STILL**2
NUM_LOOKS = 3  # round a fit, each from a better one
OUT_OF_THE_RACE = 60.0  # hypotheses, in the same: far more than any rule of a verdict looks at
LEAST_AGREEING = 2  # refined starts that must end in the best valley, lest it be a chance find
OPEN_SD_Z = 0.5  # of the prior's 1: what a phase leaves so open is scattered in the next one
# What a fit that has come to rest says of itself, well or ill.
SETTLED = (Code.CONVERGED, Code.MISFIT)


@dataclass(frozen=True)
class Settings:
    """How hard to search.

    Attributes:
      num_starts: scattered parameter vectors.
      num_refined: of these, how many are refined.
      num_second_starts: of a second search, as many by phases and as many scattered.
      num_second_refined: of all these, how many are refined.
      search_sd_m: noise assumed on the way to the fit: a camera that sees hundredths of a
        millimetre makes valleys too narrow to be met by scattered starts.
      max_steps: of Levenberg-Marquardt from one start.
      max_race_steps: the same in a race; the polish takes stragglers on from there.
      max_polish_steps: in a round with fitted noise scales.
      enough: the search stops where a step promises to lower chi2 / 2 by less.
      settled: converged where a new round with fitted noise scales lowers chi2 / 2 by no more.
        Two starts then agree within some hundredths of an sd.
      settled_if_rough: the same with MuJoCo's contacts, whose chi2 is no smoother than that.
      settled_in_turn: the same of many hypotheses, most of which no verdict will hang on.
    """

    num_starts: int = 64
    num_refined: int = 4
    num_second_starts: int = 128
    num_second_refined: int = 16
    search_sd_m: float = 0.001
    max_polish_steps: int = 80
    max_steps: int = 80
    max_race_steps: int = 20
    enough: float = 0.1
    settled: float = 0.05
    settled_if_rough: float = 0.5
    settled_in_turn: float = 0.3


class GradientFitter:
    """Fits trials; `fit` may be called for many seeds and hypotheses."""

    def __init__(self, trials: JointProblem, settings: Settings = Settings()):
        self.trials, self.settings = trials, settings
        is_smooth = trials.problems[0].engine.name == "rigid"
        self._descent = Descent(Residuals(trials), trials.coarse_steps, is_smooth, not is_smooth)
        self._residuals = self._descent.residuals
        self._count = len(trials.model_parameters)
        self._settled = settings.settled if is_smooth else settings.settled_if_rough
        parameters = trials.model_parameters
        is_nuisance = np.array([p.role == "nuisance" for p in parameters])
        self._is_main = np.array([p.role == "main" for p in parameters])
        self._is_positive_nuisance = is_nuisance & [p.is_positive for p in parameters]

    @property
    def residuals(self) -> Residuals:
        """Of the trials."""
        return self._residuals

    def compile(self, with_races: bool = False) -> None:
        """Compiles (or reads from the cache) all parts, so that `fit` only computes.

        Args:
          with_races: what many hypotheses at once need, too.
        """
        one, many = (np.zeros((n, self._count)) for n in (1, self.settings.num_starts))
        parts: list[Callable[[], Any]] = []
        if with_races:
            free = self.trials.free(self.trials.all_effects)[: self._count]
            parts.append(functools.partial(self._descent, self._batch(many, free), np.inf, 1))
        for effects in dict.fromkeys([(), self.trials.all_effects]):
            free = self.trials.free(effects)[: self._count]
            parts.append(functools.partial(self._descent, self._batch(one, free), np.inf, 1))
            parts.append(functools.partial(self._residuals.costs, self._batch(many, free)))
        if self._descent.is_smooth:
            side_by_side(parts)
        else:  # MuJoCo's engines keep one set of simulations for all batches of a size
            for part in parts:
                part()

    def fit(
        self,
        seed: int,
        on_stage: Callable[[str], None] = lambda _: None,
        effects: Sequence[str] | None = None,
        is_enough: Callable[[GradientFit], bool] | None = None,
    ) -> GradientFit:
        """Fits from scattered starts; the same seed gives the same result.

        Args:
          seed: of the starts.
          on_stage: told what is being done.
          effects: names of the effects that are there; default: all of the models'.
          is_enough: of what a first search found, whether a second one is spared; default:
            `is_explained`.
        """
        self._residuals.num_rollouts = 0
        effects = self.trials.all_effects if effects is None else effects
        free = self.trials.free(effects)[: self._count]
        on_stage("searching")
        starts = scattered_starts(self.trials, free, self.settings.num_starts, seed)
        ends = self._ends(starts, free, self.settings.num_refined)
        on_stage("refining")
        fits = self._in_valleys(ends, free)
        if ends.num_agreeing >= LEAST_AGREEING and (is_enough or self.is_explained)(_best_of(fits)):
            return self._looked_round(fits, seed)
        on_stage("searching on")
        num = self.settings.num_second_starts
        scattered = scattered_starts(self.trials, free, num, seed + 1)
        starts = np.concatenate([self._starts_by_phases(free, num, seed), scattered])
        second = self._ends(starts, free, self.settings.num_second_refined).without(ends)
        fits += self._in_valleys(second, free) if second.any else []
        if not self.is_explained(best := _best_of(fits)):
            beside = self._ends_round(best, free).without(ends).without(second)
            fits += self._in_valleys(beside, free) if beside.any else []
        fit = self._looked_round(fits, seed)
        if fit.code is Code.CONVERGED and not self.is_explained(fit, NOISE_SCALE_RANGE[1]):
            fit = replace(fit, code=Code.MISFIT)
        return fit

    def refit(self, fit: GradientFit) -> GradientFit:
        """Fits again from a fit, with its positive nuisances moved: the better of both."""
        self._residuals.num_rollouts = 0
        count = self._count
        return self._best_variant(fit.z[:count], fit.free[:count], 0)

    def continued(self, fit: GradientFit, to_rest: bool = True) -> GradientFit:
        """A fit of other sizes of imperfections, gone on from, with the valleys beside it.

        Args:
          fit: with the sizes of before.
          to_rest: whether it goes on until it stands still.
        """
        self._residuals.num_rollouts = 0
        every, count = (fit, *fit.beside), self._count
        z = np.stack([one.z for one in every])
        free = np.stack([one.free[:count] for one in every])
        points = Batch(z[:, :count], free, np.exp(NOISE_SD * z[:, count:]))
        num_steps = int(fit.stats.get("num_steps", 0))
        ends = list(self._polish(points, np.zeros(len(every), int), num_steps).values())
        found = self._at_rest(ends) if to_rest else _with_beside(ends)
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
        self._residuals.num_rollouts = 0
        points = self._batch(starts, free)
        found = self._search(points, owner)
        best = []
        for hypothesis in range(int(owner.max()) + 1):
            own = np.flatnonzero(owner == hypothesis)
            best.append(own[np.argmin(found.best.cost[own])])
        ends = points._replace(z=found.best.z).take(np.array(best))
        return list(self._polish(ends, np.arange(len(best)), found.num_steps).values())

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
        settings = self.settings
        points = self._batch(starts, free)
        return self._descent(points, settings.enough, settings.max_race_steps, give_up)

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
        return self._polish(self._batch(z, free), owner, 0)

    def polish_in_turn(
        self,
        z: Float[np.ndarray, "hypothesis parameter"],
        free: Bool[np.ndarray, "hypothesis parameter"],
        parts: Sequence[np.ndarray],
    ) -> Iterator[tuple[int, GradientFit]]:
        """Fits one end of each of several hypotheses, part by part of them, to `settled_in_turn`.

        Those far behind what an earlier part came to are left where they are.

        Args:
          z: `[hypothesis, model parameter]`.
          free: `[hypothesis, model parameter]`.
          parts: indices of hypotheses.
        """
        lowest, settled = np.inf, max(self._settled, self.settings.settled_in_turn)
        for own in parts:
            points = self._batch(z[own], free[own])
            fits, lowest = self._polish_below(points, np.arange(len(own)), 0, lowest, settled)
            for row, fit in fits.items():
                yield int(own[row]), fit

    def with_variants(self, fit: GradientFit) -> np.ndarray:
        """A fit and it with other values of the positive nuisances, `[variant, z]`."""
        count = self._count
        return np.stack(self._variants(fit.z[:count], fit.free[:count]))

    def along_nuisances(self, fit: GradientFit) -> np.ndarray:
        """Where chi2 is least as one positive nuisance moves, all else as in a fit, `[start, z]`.

        Every minimum of every line, the fit's own noise; the lines' ends, too.
        """
        z, count = fit.z[: self._count], self._count
        own = np.flatnonzero(self._is_positive_nuisance & fit.free[:count])
        points = np.tile(z, (len(own), len(ALONG_Z), 1))
        points[np.arange(len(own)), :, own] = ALONG_Z
        flat = points.reshape(-1, count)
        noise = np.tile(np.exp(NOISE_SD * fit.z[count:]), (len(flat), 1))
        free = np.tile(fit.free[:count], (len(flat), 1))
        costs = self._residuals.costs(Batch(flat, free, noise)).reshape(len(own), len(ALONG_Z))
        beside = np.pad(costs, ((0, 0), (1, 1)), constant_values=np.inf)
        is_least = (costs <= beside[:, :-2]) & (costs <= beside[:, 2:])
        return np.concatenate([z[None], points[is_least]])

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

    def _looked_round(self, fits: Sequence[GradientFit], seed: int) -> GradientFit:
        """The most evident fit, and what is found round it; with the valleys beside it."""
        best = self._at_rest(fits)
        for _ in range(NUM_LOOKS if self._descent.is_smooth else 0):
            starts = to_go_on_from((best, *best.beside), self._residuals, seed)
            if not len(starts):
                break
            points = self._batch(starts, best.free[: self._count])
            owner = np.zeros(len(starts), int)
            found = self._polish(points, owner, int(best.stats.get("num_steps", 0)))
            known, best = best, self._at_rest([best, *best.beside, *found.values()])
            if not _evidence(best) - _evidence(known) > LEADS_ON:  # nor if both failed
                break
        return replace(best, stats={**best.stats, "num_rollouts": self._residuals.num_rollouts})

    def _at_rest(self, found: Sequence[GradientFit]) -> GradientFit:
        """The most evident fit and those of other valleys that count beside it, standing still.

        What is left of the way to a fit would be, through the curvature of the misfit, a
        difference between processors, seeds and versions.
        """
        fit = _with_beside(found)
        if not self._descent.is_smooth or fit.code is not Code.CONVERGED:
            return fit
        fits, count = (fit, *fit.beside), self._count
        z = np.stack([one.z for one in fits])
        points = Batch(
            z[:, :count],
            np.stack([one.free[:count] for one in fits]),
            np.exp(NOISE_SD * z[:, count:]),
        )
        descent, most = replace(self._descent, is_central=True), self.settings.max_polish_steps
        modes = polish(descent, points, np.arange(len(fits)), STILL_NATS, most, drift=STILL)
        stats = {**fit.stats, "num_steps": fit.stats["num_steps"] + modes.num_steps}
        still = laplace_fits(self.trials, self._residuals, modes, stats)
        return _with_beside([replace(one, code=Code.CONVERGED) for one in still])

    def _ends(self, starts: np.ndarray, free: np.ndarray, num_refined: int) -> Ends:
        """Refines the best of some starts."""
        points = self._batch(starts, free)
        best = np.argsort(self._residuals.costs(points))[:num_refined]
        found = self._search(points.take(best), np.zeros(len(best), int))
        return Ends.of(found)

    def _ends_round(self, fit: GradientFit, free: np.ndarray) -> Ends:
        """Refines starts round a fit, each with one of the objects' parameters moved.

        A valley in which boxes meet again a frame later than they did may lie beside that in which
        they do: all starts that came near may have ended there. None of these is given up, however
        far behind the others it is on its way.
        """
        main = np.flatnonzero(free & self._is_main)
        which, by = np.repeat(main, len(MOVED_Z)), np.tile(MOVED_Z, len(main))
        z = fit.z[: self._count] + by[:, None] * np.eye(self._count)[which]
        points = self._batch(z, free)
        return Ends.of(self._search(points, np.arange(len(points.z))))

    def _starts_by_phases(self, free: np.ndarray, num: int, seed: int) -> np.ndarray:
        """Starts that suit what was seen before each further object moved, or a bounce."""
        is_main = free & np.array([p.role != "nuisance" for p in self.trials.model_parameters])
        centres, is_open = absent_z(self.trials)[None], is_main[None]
        for short in phases(self.trials):
            phase = GradientFitter(short, self.settings)
            starts = scattered_round(short, centres, is_open, self.settings.num_starts, seed)
            ends = phase._ends(starts, free, self.settings.num_refined)
            self._residuals.num_rollouts += phase._residuals.num_rollouts
            variance = np.diagonal(inverse(ends.best.normal), axis1=1, axis2=2)
            centres, is_open = ends.best.z, is_main & (variance > OPEN_SD_Z**2)
        return scattered_round(self.trials, centres, is_open, num, seed)

    def _in_valleys(self, ends: Ends, free: np.ndarray) -> list[GradientFit]:
        """Polishes the best of every valley and variants of the most evident; all fits.

        Variants are of what is polished: at the noise of a search, which is more than the
        clip's, the other parameters stand where the valleys beside are not yet told apart.
        """
        points = self._batch(ends.best.z, free)
        own = self._polish(points, np.zeros(len(points.z), int), ends.num_steps)
        fits = list(own.values())
        fits += self._elsewhere(_best_of(fits), free, ends.num_steps)
        if not (self._is_positive_nuisance & free).any():
            return fits
        best = _best_of(fits).z[: self._count]
        return [*fits, self._best_variant(best, free, ends.num_steps)]

    def _elsewhere(self, fit: GradientFit, free: np.ndarray, num_steps: int) -> list[GradientFit]:
        """Fits where a parameter shows that does not show in this one, or the other way round.

        Rims that grip so well that their slip ends do not tell how well: no slope leads from there
        to where they slip. A disc that slips for an instant tells its friction; one that never
        does tells nothing, and moves almost alike. What shows nowhere is left alone.
        """
        count = self._count
        z, sd = fit.z[:count], np.sqrt(np.diag(fit.covariance)[:count])
        main = np.flatnonzero(free & self._is_main)
        which, where = np.repeat(main, len(ELSEWHERE_Z)), np.tile(ELSEWHERE_Z, len(main))
        far = np.abs(where - z[which]) > FAR_SDS * sd[which]
        is_open = sd[which] > UNTOLD_SD_Z
        which, where, is_open = (each[far | is_open] for each in (which, where, is_open))
        if not len(which):
            return []
        moved = np.where(np.arange(count) == which[:, None], where[:, None], z)
        points = np.stack([z, *moved])
        noise = np.tile(np.exp(NOISE_SD * fit.z[count:]), (len(points), 1))
        costs = self._residuals.costs(Batch(points, np.tile(free, (len(points), 1)), noise))
        left = costs - 0.5 * np.sum(points**2, axis=1)  # without the prior's part
        worse = left[1:] - left[0]
        shows = np.where(is_open, np.abs(worse) > LEADS_ON, worse < BEHIND_IN_SEARCH)
        if not shows.any():
            return []
        points = self._batch(moved[shows], free)
        return list(self._polish(points, np.zeros(len(points.z), int), num_steps).values())

    def _best_variant(self, z: np.ndarray, free: np.ndarray, num_steps: int) -> GradientFit:
        """Polishes z and variants of it; the most evident fit.

        Each positive nuisance is moved alone as well, and against the others, as long as that leads
        on: bodies that leave a gap need not be those that rebound little. Noise may explain the fit
        all the same, for such a misfit is one of two or three frames.
        """
        best = self._most_evident(self._variants(z, free), free, num_steps)
        own = np.flatnonzero(self._is_positive_nuisance & free)
        for _ in own if len(own) > 1 else ():
            z, each = best.z[: self._count], np.eye(self._count, dtype=bool)[own]
            alone = [np.where(one, other, z) for one in each for other in VARIANTS_Z]
            little, lot = CROSSED_Z
            crossed = [np.where(one, little, np.where(each.any(axis=0), lot, z)) for one in each]
            found = self._most_evident([*alone, *crossed], free, num_steps)
            if not _evidence(found) - _evidence(best) > LEADS_ON:  # nor if both failed
                break
            best = found
        return best

    def _most_evident(
        self, points: Sequence[np.ndarray], free: np.ndarray, num_steps: int
    ) -> GradientFit:
        """The best fit of those polished from some points."""
        batch = self._batch(np.stack(points), free)
        fits = self._polish(batch, np.zeros(len(batch.z), int), num_steps)
        return max(fits.values(), key=_evidence)

    def _variants(self, z: np.ndarray, free: np.ndarray) -> list[np.ndarray]:
        """z, and it with other values of the positive nuisances.

        A small coefficient of restitution decides whether bodies part and meet again, so that
        the misfit has a valley on either side.
        """
        positive = self._is_positive_nuisance & free
        if not positive.any():
            return [z]
        return [z, *(np.where(positive, other, z) for other in VARIANTS_Z)]

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

    def _polish(self, points: Batch, owner: np.ndarray, num_steps: int) -> dict[int, GradientFit]:
        """By the row of the point from which each came; who joined another has none."""
        return self._polish_below(points, owner, num_steps, np.inf, self._settled)[0]

    def _polish_below(
        self, points: Batch, owner: np.ndarray, num_steps: int, lowest: float, settled: float
    ) -> tuple[dict[int, GradientFit], float]:
        """As `_polish`, and the least cost; `lowest`: that of others."""
        most = self.settings.max_polish_steps
        found = polish(self._descent, points, owner, settled, most, lowest)
        stats: dict[str, float] = {"num_steps": num_steps + found.num_steps}
        fits = laplace_fits(self.trials, self._residuals, found, stats)
        return dict(zip(found.rows.tolist(), fits, strict=True)), found.lowest


def _best_of(fits: Sequence[GradientFit]) -> GradientFit:
    return max(fits, key=_evidence)


def _with_beside(fits: Sequence[GradientFit]) -> GradientFit:
    """The most evident fit, with those of other valleys that count beside it."""
    best = _best_of(fits)
    sound = [fit for fit in fits if fit.code is Code.CONVERGED and fit is not best]
    _, *others = apart([best, *sound])
    return replace(best, beside=tuple(others))


def _evidence(fit: GradientFit) -> float:
    return fit.log_evidence

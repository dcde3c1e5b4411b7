"""The gradient fit: Levenberg-Marquardt from many starts, for many hypotheses at once.

    1. Roll out `num_starts` scattered parameter vectors in one batch; keep the best few.
    2. Levenberg-Marquardt on  [ C^-1/2 (observed - predicted(z)) ; z ],  the prior being the
       second block, for all starts (and, in a diagnosis, all hypotheses) in one batch. A step:
         a. one batch of rollouts gives the motions and their slopes (differences) at z;
         b. optimistix (Gauss-Newton) solves, for several dampings at once (vmapped), the
            problem in which the motion is linear in z but clock and camera are exact; where
            there are many hypotheses, all is taken as linear (`steps.py`): more steps, each
            far cheaper;
         c. one batch of rollouts tries all dampings; the best is taken.
    3. At the fit, with steps of half a conditional standard deviation: slopes, noise scale, one
       or two steps more.
    4. Posterior: normal in z with covariance (J^T J + 1)^-1; evidence by Laplace.

Compiled code (`programs.py`) never holds a rollout: JAX's cache keeps it between runs, whichever
the engine, and clips share it: all that differs between them is data. A single far start ends in
a side valley in most cases (the time of the collision decides which frames compare with which);
the scattered starts cost one batch.

Source: Levenberg (1944), Marquardt (1963, 10.1137/0111030); optimistix, arXiv 2402.09983.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.programs import FAILED
from galileo_jax.inference.fits.residuals import Batch, Residuals, Slopes, cost
from galileo_jax.inference.fits.starts import scattered_starts
from galileo_jax.inference.fits.steps import DAMPINGS, TRIED_SHARE, Damped, Edges, normal_matrices
from galileo_jax.inference.trials import NOISE_SD, Trials
from galileo_jax.parameters import inverse
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood

# Of a parameter's coarse step: below the smallest MuJoCo's contacts are rough, and the rigid
# engine rounds; above the largest a step may leave a plateau (nothing moves) over its edge, and
# the plateau would look steep.
SMALLEST_STEP, SMALLEST_ROUGH_STEP, LARGEST_STEP = 1e-3, 0.2, 4.0
NUM_FOLLOWED = 3  # of a step's dampings
VARIANTS_Z = (-1.0, 0.5, 2.0)  # of positive nuisances, tried from every fit
# A fit that is so many nats behind another, and makes up less than this share of it in a step, is
# left where it is.
BEHIND, CATCHES_UP = 100.0, 0.1
# Starts of one hypothesis, in nats of the search's coarse noise, and after how many steps.
BEHIND_IN_SEARCH, STEPS_BEFORE_GIVING_UP = 20.0, 3


@dataclass(frozen=True)
class Settings:
    """How hard to search.

    Attributes:
      num_starts: scattered parameter vectors.
      num_refined: of these, how many are refined.
      search_sd_m: noise assumed on the way to the fit: a camera that sees hundredths of a
        millimetre makes valleys too narrow to be met by scattered starts.
      max_steps: Levenberg-Marquardt steps from one start.
      max_polish_steps: with slopes at the posterior's scale.
      enough: stop where a step lowers chi2 / 2 by less.
      num_exact: up to so many points at once, optimistix solves the steps with clock and camera
        exact; its program takes some seconds to build, so that 0 is quicker for a library.
      settled: converged where neither a step with slopes at the posterior's scale nor a walk of
        one or three sd along the softest directions lowers chi2 / 2 by more. Two starts then
        agree within some hundredths of an sd.
      settled_if_rough: the same with MuJoCo's contacts, whose chi2 is no smoother than that.
    """

    num_starts: int = 64
    num_refined: int = 4
    search_sd_m: float = 0.001
    max_polish_steps: int = 15
    max_steps: int = 15
    enough: float = 0.5
    num_exact: int = 4
    settled: float = 0.05
    settled_if_rough: float = 0.5


class Code(StrEnum):
    """How a fit ended; the value is the sentence for the user."""

    CONVERGED = "the fit converged"
    STEP_LIMIT = "the fit has not settled; try another --seed or --method mh"
    FAILED = "no rollout succeeded; check the clip's geometry"


@dataclass(frozen=True)
class GradientFit:
    """The best fit of one hypothesis and the normal approximation round it.

    Attributes:
      z: `[parameter]`, the mode, noise scales last; 0 where pinned.
      free: `[parameter]`, which parameters the hypothesis has.
      covariance: `[parameter, parameter]`, in z; 0 where pinned.
      chi2: sum of squared whitened residuals at the tracker's own noise (scale 1).
      log_evidence: of the hypothesis, by Laplace, up to the data's constant.
      num_values: how many numbers were measured.
      steps: `[model parameter]`, the difference steps of the final Jacobian, in z.
      jacobian: `[value, model parameter]`, d(whitened residual)/dz at the fit, clip after clip;
        values as in `Problem.whiten`; 0 where pinned.
      code: how it ended.
      stats: rollouts and steps it took.
      pull: how far the nuisances are from their priors' middle: the sum of their squared z.
    """

    z: np.ndarray
    free: np.ndarray
    covariance: np.ndarray
    chi2: float
    log_evidence: float
    num_values: int
    steps: np.ndarray
    jacobian: np.ndarray
    code: Code
    stats: dict[str, float]
    pull: float

    @property
    def num_used(self) -> float:
        """How many numbers' worth of the data the parameters were fitted with."""
        count = len(self.steps)
        return float(np.sum(self.free[:count]) - np.trace(self.covariance[:count, :count]))


class GradientFitter:
    """Fits trials; `fit` may be called for many seeds and hypotheses."""

    def __init__(self, trials: Trials, settings: Settings = Settings()):
        self.trials, self.settings = trials, settings
        self._residuals = Residuals(trials)
        self._count = len(trials.model_parameters)
        self._num_values = np.array([p.data.num_values for p in trials.problems], float)
        parameters = trials.model_parameters
        is_smooth = trials.problems[0].engine.name == "rigid"
        self._smallest_step = SMALLEST_STEP if is_smooth else SMALLEST_ROUGH_STEP
        self._settled = settings.settled if is_smooth else settings.settled_if_rough
        self._is_nuisance = np.array([p.role == "nuisance" for p in parameters])
        zero = np.array(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
        self._is_positive_nuisance = self._is_nuisance & ~np.isfinite(zero)
        self._edges = Edges.of(parameters)

    def compile(self) -> None:
        """Compiles (or reads from the cache) all parts, so that `fit` only computes."""
        free = self.trials.free(self.trials.all_effects)[: self._count]
        points = self._batch(np.zeros((1, self._count)), free)
        slopes = self._residuals.slopes(points, self.trials.coarse_steps[None], is_central=False)
        self._try(points, slopes, np.full(1, np.inf))
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
        starts = self._batch(scattered_starts(self.trials, free, self.settings.num_starts, seed), free)
        best = np.argsort(self._residuals.costs(starts))[: self.settings.num_refined]
        found, costs, num_steps = self._search(starts.take(best))
        on_stage("refining")
        return self._best_variant(found.z[np.argmin(costs)], free, num_steps)

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
          free: `[start, model parameter]`, see `Trials.free`.
          owner: `[start]`, which hypothesis each belongs to, ascending from 0.

        Returns:
          One fit per hypothesis, of its best start.
        """
        self._residuals.num_rollouts = 0
        found, costs, num_steps = self._search(self._batch(starts, free), owner)
        best = []
        for hypothesis in range(int(owner.max()) + 1):
            own = np.flatnonzero(owner == hypothesis)
            best.append(own[np.argmin(costs[own])])
        return self._polish(found.take(np.array(best)), num_steps)

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

    def _search(
        self, points: Batch, owner: np.ndarray | None = None
    ) -> tuple[Batch, np.ndarray, int]:
        """Levenberg-Marquardt from every point.

        Slopes are by turns coarse, which see past small dips, and as fine as the search's noise
        lets one tell: across a narrow valley a coarse one points out of it. Of points with the
        same `owner` (default: each has its own), those far behind are given up.
        """
        owner = np.arange(len(points.z)) if owner is None else owner
        z, num_steps = points.z.copy(), 0
        coarse = self.trials.coarse_steps
        steps = np.tile(coarse, (len(z), 1))
        costs = self._residuals.costs(points)
        active = np.arange(len(z))
        last_gain = np.full(len(z), np.inf)
        for turn in range(self.settings.max_steps):
            here = Batch(z, points.free, points.noise).take(active)
            widths = np.broadcast_to(coarse, here.z.shape) if turn % 2 == 0 else steps[active]
            slopes = self._residuals.slopes(here, widths, is_central=False)
            steps[active] = np.minimum(self._half_sd(slopes.jacobian), coarse)
            moved, after = self._try(here, slopes, costs[active])
            gain = costs[active] - after
            z[active], costs[active] = moved, after
            num_steps += 1
            stays = np.maximum(gain, last_gain[active]) >= self.settings.enough
            last_gain[active] = gain
            active = active[stays]
            if num_steps >= STEPS_BEFORE_GIVING_UP:
                lowest = np.full(owner.max() + 1, np.inf)
                np.minimum.at(lowest, owner, costs)
                active = active[costs[active] - lowest[owner[active]] < BEHIND_IN_SEARCH]
            if not active.size:
                break
        return Batch(z, points.free, points.noise), costs, num_steps

    def _polish(self, points: Batch, num_steps: int) -> list[GradientFit]:
        """Slopes at the posterior's scale, noise scales, and a look along the valleys."""
        settings = self.settings
        z, noise = points.z.copy(), points.noise.copy()
        count = len(z)
        steps = np.tile(self.trials.coarse_steps, (count, 1))
        is_settled = np.zeros(count, bool)
        misfit = np.full(count, np.inf)  # with what the noise scale costs
        active = np.arange(count)
        for _ in range(settings.max_polish_steps):
            here = Batch(z, points.free, noise).take(active)
            slopes = self._residuals.slopes(here, steps[active], is_central=True)
            covariance = _covariances(slopes.jacobian, here.free)
            before = here.noise
            scales = self._noise_scales(slopes.white, before, covariance, here.free)
            steps[active] = self._half_sd(slopes.jacobian)
            noise[active] = scales
            here = here._replace(noise=scales)
            scaled = [
                w * (b / s)[:, None]
                for w, b, s in zip(slopes.white, before.T, scales.T, strict=True)
            ]
            costs = cost(scaled, here.z)
            moved, after = self._try(here, slopes._replace(white=scaled), costs)
            z[active] = moved
            num_steps += 1
            drifts = np.abs(scales / before - 1).max(axis=1) > 0.1
            done = (costs - after < self._settled) & ~drifts
            if done.any():
                # No damping helps. In a narrow, rough valley that is no proof: look along it.
                chosen = np.flatnonzero(done)
                there = here._replace(z=moved).take(chosen)
                best, lowest = self._walk(there, covariance[chosen])
                settled = after[chosen] - lowest < self._settled
                is_settled[active[chosen[settled]]] = True
                z[active[chosen[~settled]]] = best[~settled]
            misfit[active] = after + np.log(scales) @ self._num_values
            behind = misfit[active] - misfit.min()
            gives_up = (behind > BEHIND) & (costs - after < CATCHES_UP * behind)
            active = active[~is_settled[active] & ~gives_up]
            if not active.size:
                break
        return self._finish(Batch(z, points.free, noise), steps, is_settled, num_steps)

    def _finish(
        self, points: Batch, steps: np.ndarray, is_settled: np.ndarray, num_steps: int
    ) -> list[GradientFit]:
        _, jacobian, white = self._residuals.slopes(points, steps, is_central=True)
        covariance = _covariances(jacobian, points.free)
        fits = []
        for i in range(len(points.z)):
            scale = points.noise[i]
            chi2 = sum(float(np.sum((w[i] * s) ** 2)) for w, s in zip(white, scale, strict=True))
            free = np.append(points.free[i], np.ones(len(scale), bool))
            whole = np.zeros((len(free),) * 2)
            whole[: self._count, : self._count] = covariance[i]
            for c, clip in enumerate(self._residuals.clips):
                at = self._count + c
                count = float(GaussianLikelihood.degrees(scale[c], clip.data.whitening))
                whole[at, at] = 1 / (1 + 2 * count * NOISE_SD**2)
            failed = max(float(np.abs(w[i]).max()) for w in white) >= FAILED
            code = Code.CONVERGED if is_settled[i] else Code.STEP_LIMIT
            at_unit = np.concatenate(
                [
                    clip.unpadded(j[i])
                    for clip, j in zip(self._residuals.clips, jacobian, strict=True)
                ]
            )
            fits.append(
                GradientFit(
                    z=np.append(points.z[i], np.log(scale) / NOISE_SD),
                    free=free,
                    covariance=whole,
                    chi2=chi2,
                    log_evidence=self._log_evidence(i, points, white, whole),
                    num_values=self.trials.num_values,
                    steps=steps[i],
                    jacobian=at_unit,
                    code=Code.FAILED if failed else code,
                    stats={"num_steps": num_steps, "num_rollouts": self._residuals.num_rollouts},
                    pull=float(np.sum(points.z[i][self._is_nuisance] ** 2)),
                )
            )
        return fits

    def _log_evidence(self, i: int, points: Batch, white: list, covariance: np.ndarray) -> float:
        """Laplace: the density at the mode times the posterior's volume over the prior's."""
        scale = points.noise[i]
        total = -cost([w[i : i + 1] for w in white], points.z[i : i + 1])[0]
        total -= 0.5 * float(np.sum((np.log(scale) / NOISE_SD) ** 2))
        for clip, s in zip(self._residuals.clips, scale, strict=True):
            data = clip.data.whitening
            total -= 0.5 * float(GaussianLikelihood.log_determinant(s, data))
        free = np.append(points.free[i], np.ones(len(scale), bool))
        return total + 0.5 * float(np.linalg.slogdet(covariance[np.ix_(free, free)])[1])

    def _walk(self, points: Batch, covariance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The best point along the softest directions, and its cost, of each."""
        best, lowest = points.z.copy(), np.full(len(points.z), np.inf)
        walks = [
            self._edges.curve(z, _along_soft_directions(z, c, free) - z)
            for z, c, free in zip(points.z, covariance, points.free, strict=True)
        ]
        owner = np.concatenate([np.full(len(walk), i) for i, walk in enumerate(walks)])
        costs = self._residuals.costs(points.take(owner)._replace(z=np.concatenate(walks)))
        for i, walk in enumerate(walks):
            own = costs[owner == i]
            best[i], lowest[i] = walk[np.argmin(own)], own.min()
        return best, lowest

    def _try(
        self, points: Batch, slopes: Slopes, costs: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The best of all dampings' proposals, or the point itself."""
        here = points.z[:, None]
        if len(points.z) <= self.settings.num_exact:
            found = self._residuals.solved(points, slopes, DAMPINGS)
            tried = self._edges.curve(here, np.where(np.isfinite(found), found - here, 0.0))
            after = self._residuals.costs_of(tried, points)
        else:
            damped, edges = Damped.of(points.free, slopes.jacobian), self._edges
            which = np.tile(np.arange(len(TRIED_SHARE)), (len(here), 1))
            step = damped.steps(here, [w[:, None] for w in slopes.white], edges.reach(here), which)
            tried = edges.curve(here, step)
            there = self._residuals.whites_of(tried, points)
            after = cost(there, tried)
            # Once more from where the best end, with the slopes of where they began: a valley's
            # bend is followed at the price of a rollout.
            which = np.argsort(after, axis=1)[:, :NUM_FOLLOWED, None]
            bent = np.take_along_axis(tried, which, axis=1)
            there = [np.take_along_axis(w, which, axis=1) for w in there]
            step = damped.steps(bent, there, edges.reach(bent), which[..., 0])
            again = edges.curve(bent, step)
            after = np.concatenate([after, self._residuals.costs_of(again, points)], axis=1)
            tried = np.concatenate([tried, again], axis=1)
        best = np.argmin(after, axis=1)
        rows = np.arange(len(points.z))
        lowest = after[rows, best]
        improves = lowest < costs
        z = np.where(improves[:, None], tried[rows, best], points.z)
        return z, np.where(improves, lowest, costs)

    def _noise_scales(
        self, white: list, noise: np.ndarray, covariance: np.ndarray, free: np.ndarray
    ) -> np.ndarray:
        """The noise scales that residuals ask for, `[point, clip]`."""
        used = free.sum(axis=1) - np.trace(covariance, axis1=1, axis2=2)
        wide = 1 / (2 * NOISE_SD**2)  # the prior, at 1, is worth this many values
        scales = np.empty_like(noise)
        for c, clip in enumerate(self._residuals.clips):
            data = clip.data.whitening
            share = used * float(data.num_values) / self.trials.num_values
            total = np.sum((white[c] * noise[:, c : c + 1]) ** 2, axis=1)
            for i, scale in enumerate(noise[:, c]):
                count = float(GaussianLikelihood.degrees(scale, data))
                left = max(count - share[i], 1.0)
                scales[i, c] = np.sqrt((total[i] + wide) / (left + wide))
        return scales

    def _half_sd(self, jacobian: list) -> np.ndarray:
        """Difference steps in z: half a conditional sd, within what slopes are good for.

        Conditional, the others held: along a ridge (all masses by the same factor) the
        marginal sd is large, and differences over it would bend the ridge.
        """
        coarse = self.trials.coarse_steps
        half = 0.5 / np.sqrt(1 + np.sum([np.sum(j**2, axis=1) for j in jacobian], axis=0))
        return np.clip(half, self._smallest_step * coarse, LARGEST_STEP * coarse)


def _covariances(jacobian: Sequence[np.ndarray], free: np.ndarray) -> np.ndarray:
    """Laplace covariances of z, `[point, parameter, parameter]`; 0 where pinned."""
    normal = normal_matrices(jacobian)
    covariance = np.zeros(normal.shape)
    for i, own in enumerate(free):
        block = np.ix_(own, own)
        covariance[i][block] = np.linalg.inv(normal[i][block] + np.eye(int(own.sum())))
    return covariance


def _along_soft_directions(z: np.ndarray, covariance: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Points one and three sd off z along the three softest directions the data determine."""
    own = np.flatnonzero(free)
    variance, vectors = np.linalg.eigh(covariance[np.ix_(own, own)])
    soft = [i for i in np.argsort(-variance) if variance[i] < 0.5][:3]
    if not soft:
        return z[None]
    walks = []
    for i in soft:
        for c in (-3, -1, 1, 3):
            moved = z.copy()
            moved[own] += c * np.sqrt(variance[i]) * vectors[:, i]
            walks.append(moved)
    return np.stack(walks)

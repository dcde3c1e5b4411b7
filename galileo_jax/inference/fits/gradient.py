"""The gradient fit: multi-start Levenberg-Marquardt and a Laplace posterior.

    1. Roll out `num_starts` scattered parameter vectors in one batch; keep the best few.
    2. Levenberg-Marquardt on  [ C^-1/2 (observed - predicted(z)) ; z ],  the prior being the
       second block. One step:
         a. one batch of rollouts gives the motion and its slopes (differences) at z;
         b. optimistix (Gauss-Newton) solves, for several dampings at once (vmapped), the
            problem in which the motion is linear in z but clock and scale are exact;
         c. one batch of rollouts tries all dampings; the best is taken.
    3. At the fit, with steps of half a posterior standard deviation: slopes, noise scale, one
       or two steps more.
    4. Posterior: normal in z with covariance (J^T J + 1)^-1.

Compiled code never holds a rollout: JAX's cache keeps it between runs, whichever the engine,
and no solver step is spent on a trial that a batch can try beside others. A single far start
ends in a side valley in most cases (the time of the collision decides which frames compare
with which); the scattered starts cost one batch.

Source: Levenberg (1944), Marquardt (1963, 10.1137/0111030); optimistix, arXiv 2402.09983.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
from scipy.special import ndtri

from galileo_jax.inference.problem import FAILED, NOISE_SD, Problem
from galileo_jax.parameters import forward, inverse
from galileo_jax.rollout.trajectory import Trajectory
from galileo_jax.similarity.gaussian_likelihood import GaussianLikelihood, Whitening

# Against the columns' sizes. Valleys are narrow (masses against friction): most of the range is
# needed below 1e-2, where steps along them differ.
DAMPINGS = np.array([0.0, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1e1])
# Of a parameter's coarse step: below it contacts are rough; above it a step may leave a plateau
# (nothing moves) over its edge, and the plateau would look steep.
SMALLEST_STEP, LARGEST_STEP = 0.2, 4.0


@dataclass(frozen=True)
class Settings:
    """How hard to search.

    Attributes:
      num_starts: scattered parameter vectors.
      num_refined: of these, how many are refined at the most.
      search_sd_m: noise assumed on the way to the fit: a camera that sees hundredths of a
        millimetre makes valleys too narrow to be met by scattered starts.
      good_chi2_per_value: below it, at that noise, no further start is refined.
      max_steps: Levenberg-Marquardt steps from one start.
      max_polish_steps: with slopes at the posterior's scale.
      enough: stop where a step lowers chi2 / 2 by less.
      settled: converged where neither a step with slopes at the posterior's scale nor a walk of
        one or three sd along the softest directions lowers chi2 / 2 by more.
    """

    num_starts: int = 64
    num_refined: int = 4
    search_sd_m: float = 0.001
    good_chi2_per_value: float = 2.0
    max_polish_steps: int = 20
    max_steps: int = 15
    enough: float = 0.5
    settled: float = 0.5


class Code(StrEnum):
    """How a fit ended; the value is the sentence for the user."""

    CONVERGED = "the fit converged"
    STEP_LIMIT = "the fit has not settled; try another --seed or --method mh"
    FAILED = "no rollout succeeded; check the clip's geometry"


@dataclass(frozen=True)
class GradientFit:
    """The best fit and the normal approximation round it.

    Attributes:
      z: `[parameter]`, the mode, noise scale last.
      covariance: `[parameter, parameter]`, in z.
      chi2: sum of squared whitened residuals at the tracker's own noise (scale 1).
      num_values: how many numbers were measured.
      steps: `[model parameter]`, the difference steps of the final Jacobian, in z.
      jacobian: `[value, model parameter]`, d(whitened residual)/dz at the fit; values as in
        `Problem.residuals`.
      code: how it ended.
      stats: rollouts and steps it took.
    """

    z: np.ndarray
    covariance: np.ndarray
    chi2: float
    num_values: int
    steps: np.ndarray
    jacobian: np.ndarray
    code: Code
    stats: dict[str, float]


class GradientFitter:
    """The fit's compiled parts for one problem; `fit` may be called for many seeds."""

    def __init__(self, problem: Problem, settings: Settings = Settings()):
        self.problem, self.settings = problem, settings
        self._num_rollouts = 0
        self._data = _padded(problem)
        self._num_records = _up(problem.model.num_records + 1, RECORDS)
        parameters = problem.model.parameters
        record_times = np.arange(self._num_records) * problem.model.record_dt_s
        self._simulated = np.array([i for i, p in enumerate(parameters) if p.step is not None])

        def residuals(z, motion, noise_scale, data):
            position, velocity = motion
            # The drawn pitch is no measurement, so that none is made up here.
            whole = Trajectory(record_times, position, velocity, position[:, 0])  # pyright: ignore
            difference = data.whitening.observed_m - problem.measure(z, whole, data.times_s)
            white = GaussianLikelihood.whiten(difference, noise_scale, data.whitening).reshape(-1)
            return jnp.where(jnp.isfinite(white), white, FAILED)

        def linear(u, motion, slopes):
            return tuple(
                value + jnp.tensordot(u, slope, axes=1)
                for value, slope in zip(motion, slopes, strict=True)
            )

        def model_residuals(u, z, motion, slopes, noise_scale, data):
            return residuals(z + u, linear(u, motion, slopes), noise_scale, data)

        def solve(damping, size, z, motion, slopes, noise_scale, data):
            def objective(u, _):
                white = model_residuals(u, z, motion, slopes, noise_scale, data)
                return jnp.concatenate([white, z + u, jnp.sqrt(damping) * size * u])

            solver = optx.GaussNewton(rtol=1e-3, atol=1e-3)
            start = jnp.zeros_like(z)
            return z + optx.least_squares(objective, solver, start, max_steps=8, throw=False).value

        self._forward = jax.jit(lambda z: forward(parameters, z))
        self._residuals = jax.jit(jax.vmap(residuals, (0, 0, None, None)))
        self._jacobian = jax.jit(
            lambda z, *rest: jax.jacfwd(model_residuals)(jnp.zeros_like(z), z, *rest)
        )
        self._solve = jax.jit(jax.vmap(solve, (0, None, None, None, None, None, None)))

    def compile(self) -> None:
        """Compiles (or reads from the cache) all parts, so that `fit` only computes."""
        z = np.zeros(len(self.problem.model.parameters))
        shape = (len(self.problem.model.scene.names), 2, self._num_records)
        motion = (np.zeros(shape), np.zeros(shape))
        slopes = tuple(np.zeros((len(z), *shape)) for _ in range(2))
        self._jacobian(z, motion, slopes, 1.0, self._data)
        self._solve(DAMPINGS, np.ones(len(z)), z, motion, slopes, 1.0, self._data)
        for size in (1, len(DAMPINGS), self.settings.num_starts):
            batch = tuple(np.zeros((size, *shape)) for _ in range(2))
            self._residuals(np.tile(z, (size, 1)), batch, 1.0, self._data)

    def fit(self, seed: int, on_stage: Callable[[str], None] = lambda _: None) -> GradientFit:
        """Fits; the same seed gives the same result."""
        settings = self.settings
        self._num_rollouts = 0
        on_stage("searching")
        z, num_steps = self._search(seed)
        on_stage("refining")
        steps, is_settled = self.problem.coarse_steps, False
        noise_scale = self._search_noise
        for _ in range(settings.max_polish_steps):
            motion, slopes = self._slopes(z, steps)
            jacobian = np.asarray(self._jacobian(z, motion, slopes, noise_scale, self._data))
            covariance = _covariance(jacobian)
            residual = self._white(z, motion, noise_scale)
            effective = len(z) - float(np.trace(covariance))
            before = noise_scale
            noise_scale = self._noise_scale(residual * noise_scale, effective)
            steps = self._half_sd(covariance)
            cost = self._cost_of(residual * before / noise_scale, z)
            z, after = self._step(z, motion, slopes, noise_scale, cost)
            num_steps += 1
            if cost - after > settings.settled or abs(noise_scale / before - 1) > 0.1:
                continue
            # No damping helps. In a narrow, rough valley that is no proof: look along it.
            tried = _along_soft_directions(z, covariance)
            costs = self._costs(tried, noise_scale)
            is_settled = bool(after - costs.min() < settings.settled)
            if is_settled:
                break
            z = tried[np.argmin(costs)]
        motion, slopes = self._slopes(z, steps)
        jacobian = np.asarray(self._jacobian(z, motion, slopes, noise_scale, self._data))
        at_unit = self._white(z, motion, 1.0)
        count = int(self.problem.data.num_values)
        whole = np.zeros((len(z) + 1,) * 2)
        whole[:-1, :-1] = _covariance(jacobian)
        whole[-1, -1] = 1 / (1 + 2 * count * NOISE_SD**2)
        code = Code.CONVERGED if is_settled else Code.STEP_LIMIT
        if np.abs(at_unit).max() >= FAILED:
            code = Code.FAILED
        return GradientFit(
            z=np.append(z, np.log(noise_scale) / NOISE_SD),
            covariance=whole,
            chi2=float(np.sum(at_unit**2)),
            num_values=count,
            steps=steps,
            jacobian=self._unpadded(jacobian),
            code=code,
            stats={"num_steps": num_steps, "num_rollouts": self._num_rollouts},
        )

    def _search(self, seed: int) -> tuple[np.ndarray, int]:
        """The best of the refined starts, z, and how many steps that took."""
        settings = self.settings
        starts = self._starts(seed)
        noise = self._search_noise
        cost = self._costs(starts, noise)
        order = np.argsort(cost)
        count = float(self.problem.data.num_values)
        best, best_cost, num_steps = starts[order[0]], np.inf, 0
        for i in order[: settings.num_refined]:
            z, now = starts[i], float(cost[i])
            for _ in range(settings.max_steps):
                motion, slopes = self._slopes(z, self.problem.coarse_steps, is_central=False)
                z, after = self._step(z, motion, slopes, noise, now)
                num_steps += 1
                if now - after < settings.enough:
                    break
                now = after
            if now < best_cost:
                best, best_cost = z, now
            if best_cost < 0.5 * settings.good_chi2_per_value * count:
                break
        return best, num_steps

    def _step(
        self,
        z: np.ndarray,
        motion: tuple[np.ndarray, np.ndarray],
        slopes: tuple[np.ndarray, np.ndarray],
        noise_scale: float,
        cost: float,
    ) -> tuple[np.ndarray, float]:
        """One Levenberg-Marquardt step: the best of all dampings (or none) and its cost."""
        jacobian = np.asarray(self._jacobian(z, motion, slopes, noise_scale, self._data))
        size = np.sqrt(1 + np.sum(jacobian**2, axis=0))
        tried = np.asarray(self._solve(DAMPINGS, size, z, motion, slopes, noise_scale, self._data))
        tried = np.where(np.isfinite(tried), tried, z)
        costs = self._costs(tried, noise_scale)
        best = int(np.argmin(costs))
        return (tried[best], float(costs[best])) if costs[best] < cost else (z, cost)

    def _simulate(self, zs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        self._num_rollouts += len(zs)
        theta = np.stack([np.asarray(self._forward(z)) for z in zs])
        position, velocity = self.problem.engine.simulate(theta)
        missing = [(0, 0)] * 3 + [(0, self._num_records - position.shape[-1])]
        return np.pad(position, missing, mode="edge"), np.pad(velocity, missing)

    def _costs(self, zs: np.ndarray, noise_scale: float) -> np.ndarray:
        """chi2 / 2 and the prior's part, `[batch]`."""
        white = np.asarray(self._residuals(zs, self._simulate(zs), noise_scale, self._data))
        return 0.5 * (np.sum(white**2, axis=1) + np.sum(zs**2, axis=1))

    @staticmethod
    def _cost_of(white: np.ndarray, z: np.ndarray) -> float:
        return 0.5 * float(np.sum(white**2) + np.sum(z**2))

    def _white(
        self, z: np.ndarray, motion: tuple[np.ndarray, np.ndarray], noise: float
    ) -> np.ndarray:
        return np.asarray(
            self._residuals(z[None], tuple(m[None] for m in motion), noise, self._data)[0]
        )

    def _slopes(self, z: np.ndarray, steps: np.ndarray, is_central: bool = True):
        """The motion at z and its differences, `[model parameter, object, 2, record]`."""
        h = np.asarray(steps)[self._simulated]
        offsets = np.zeros((len(h), len(z)))
        offsets[np.arange(len(h)), self._simulated] = h
        batch = [z[None], z + offsets, *([z - offsets] if is_central else [])]
        out = self._simulate(np.concatenate(batch))
        slopes = []
        for values in out:
            low, width = (values[1 + len(h) :], 2 * h) if is_central else (values[:1], h)
            slope = np.zeros((len(z), *values.shape[1:]))
            slope[self._simulated] = (values[1 : 1 + len(h)] - low) / width[:, None, None, None]
            slopes.append(slope)
        return (out[0][0], out[1][0]), tuple(slopes)

    @property
    def _search_noise(self) -> float:
        """The noise scale at which the tracker's median error is `search_sd_m`."""
        observation = self.problem.observation
        variance = np.trace(observation.covariance_m2, axis1=1, axis2=2)[observation.mask] / 2
        if not variance.size:
            return 1.0
        return max(1.0, self.settings.search_sd_m / float(np.sqrt(np.median(variance))))

    def _noise_scale(self, residual: np.ndarray, effective: float) -> float:
        """The noise scale that residuals (in units of the tracker's noise) ask for."""
        count = float(self.problem.data.num_values)
        wide = 1 / (2 * NOISE_SD**2)  # the prior, at 1, is worth this many values
        total = float(np.sum(residual**2))
        return float(np.sqrt((total + wide) / (max(count - effective, 1.0) + wide)))

    def _unpadded(self, jacobian: np.ndarray) -> np.ndarray:
        """Rows of real frames only."""
        shape = self._data.whitening.observed_m.shape
        rows = jacobian.reshape(*shape, -1)[:, :, : len(self.problem.observation.times_s)]
        return rows.reshape(-1, jacobian.shape[1])

    def _half_sd(self, covariance: np.ndarray) -> np.ndarray:
        """Difference steps in z: half the posterior's sd, within what slopes are good for."""
        coarse = self.problem.coarse_steps
        half = 0.5 * np.sqrt(np.diag(covariance))
        return np.clip(half, SMALLEST_STEP * coarse, LARGEST_STEP * coarse)

    def _starts(self, seed: int) -> np.ndarray:
        """Scattered starts in z: main parameters in a Latin hypercube, all others at rest."""
        parameters = self.problem.model.parameters
        count = self.settings.num_starts
        rest = np.array(inverse(parameters, jnp.asarray([p.absent for p in parameters])))
        rest = np.clip(rest, -1.0, 1.0)  # an absent half-normal has no slope
        free = [i for i, p in enumerate(parameters) if p.role == "main"]
        generator = np.random.default_rng(seed)
        ranks = np.stack([generator.permutation(count) for _ in free], axis=1)
        share = (ranks + generator.random(ranks.shape)) / count
        starts = np.tile(rest, (count, 1))
        angle = self.problem.model.scene.surroundings.angle_rad
        for column, i in enumerate(free):
            u = share[:, column]
            if parameters[i].name.startswith("k"):
                # Above tan(angle) nothing slides and every start looks alike.
                u = u * min(np.tan(angle) if parameters[i].name == "k1" else 0.5, 0.98) + 0.01
            starts[:, i] = ndtri(np.clip(u, 0.01, 0.99))
        return starts


class Padded(NamedTuple):
    """A clip's data in shapes that many clips share, so that they share compiled code.

    Attributes:
      times_s: `[frame]`.
      whitening: with masked frames and idle modes added.
    """

    times_s: np.ndarray
    whitening: Whitening


FRAMES, MODES, RECORDS = 64, 32, 512  # sizes are rounded up to multiples of these


def _up(size: int, multiple: int) -> int:
    return -(-size // multiple) * multiple


def _padded(problem: Problem) -> Padded:
    """Pads with frames that count for nothing and modes without gain."""
    times, data = problem.observation.times_s, problem.data
    frames = _up(len(times), FRAMES) - len(times)
    modes = _up(len(data.gain), MODES) - len(data.gain)
    whitening = Whitening(
        np.pad(data.observed_m, [(0, 0), (0, 0), (0, frames)]),
        np.pad(data.inverse_root, [(0, 0), (0, 0), (0, 0), (0, frames)]),
        np.pad(data.basis, [(0, modes), (0, 0), (0, 0), (0, frames)]),
        np.pad(data.gain, (0, modes)),
        data.num_values,
    )
    return Padded(np.pad(times, (0, frames), mode="edge"), whitening)


def _along_soft_directions(z: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Points one and three sd off z along the three softest directions the data determine."""
    variance, vectors = np.linalg.eigh(covariance)
    soft = [i for i in np.argsort(-variance) if variance[i] < 0.5][:3]
    offsets = [c * np.sqrt(variance[i]) * vectors[:, i] for i in soft for c in (-3, -1, 1, 3)]
    return z + np.array(offsets).reshape(-1, len(z)) if offsets else z[None]


def _covariance(jacobian: np.ndarray) -> np.ndarray:
    """The Laplace covariance of z, [parameter, parameter], prior included."""
    return np.linalg.inv(jacobian.T @ jacobian + np.eye(jacobian.shape[1]))

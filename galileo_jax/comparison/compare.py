"""Is the model adequate for these data, and where does it fail?

Many local tests (`local_tests`) make one global p-value: each statistic is standardised by its
distribution over the parametric bootstrap's replicates (`bootstrap`), the largest of them is
the global statistic, and its p-value is that of the same maximum over the replicates. That is
calibrated without assuming that the rollout is linear or the tests independent, and corrected
for having looked in many places (Westfall and Young 1993; arXiv 2412.15100). Beyond what the
replicates reach, a Gumbel distribution fitted to them is used.

Residuals are the tracking errors that the fit leaves (`Whitening.tracking_errors`), at
the noise scale that they ask for themselves, of the data as of every replicate; so p is uniform
under the model, whether the imperfections that the likelihood allows for are there or not.

A nuisance parameter that lies many prior standard deviations from its prior mean also counts as a
failure, because the residuals no longer show that misfit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.special import ndtr

from galileo_jax.comparison.bootstrap import replicates
from galileo_jax.comparison.local_tests import Cell, find_cells, statistics
from galileo_jax.comparison.phases import phases
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import NOISE_SCALE_RANGE, NOISE_SD, JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.inference.result import PULLED_Z, error_of, velocity_residuals
from galileo_jax.model.parameters import prior_deviations
from galileo_jax.similarity.gaussian_likelihood import Whitening, is_measured
from galileo_jax.similarity.noise_scale import errors_at, fitted_mode_size, fitted_noise_scale

NUM_REPLICATES = 200
ADEQUATE_P = 0.01
# Residuals are judged by the tracker's own noise, or what they say of it if that is more:
# a camera that sees still objects better than it states still blurs moving ones.
JUDGED_SCALE_RANGE = (1.0, NOISE_SCALE_RANGE[1])
ANY_SCALE = (0.0, np.inf)
# Where modes take up so much of a cell's values, as of how a box wobbles across its way, what they
# leave is as large as these imperfections happen to be in a clip, and tells nothing of the model.
ABSORBED = 0.9
# Of the chance of a false alarm, how much is spent on the nuisances. They are far inside their
# priors in most clips, so that an equal share would cost the residuals half of theirs.
PULL_SHARE = 0.05


@dataclass(frozen=True)
class Place:
    """One cell in numbers."""

    clip: str
    object: str
    axis: str
    phase: str
    rmse: float  # of the velocity's residuals, m/s
    noise: float  # what the stated tracking errors alone give, m/s
    z: float  # the largest of its statistics, in standard deviations of the replicates
    whiteness: float  # correlation of neighbouring residuals


@dataclass(frozen=True)
class Pull:
    """A nuisance outside of what its prior allows: `z` prior standard deviations away."""

    parameter: str
    value: float
    unit: str
    z: float


@dataclass(frozen=True)
class Comparison:
    """A fitted hypothesis against the data."""

    # global, of the model being adequate; if the noise is misstated, with noise of the size that is
    # there
    p_value: float
    where: tuple[Place, ...]  # all cells, the worst first
    pulls: tuple[Pull, ...]  # nuisances outside their priors, the worst first
    error: Mapping[str, float]  # rmse, noise, l1, l2 (m/s) and chi2_per_dof
    labels: tuple[np.ndarray, ...]  # of each clip `[object, frame]`, indices into `phases.PHASES`
    # of each clip `[object, 2, frame]`, the tracking errors that the fit leaves, in units of the
    # stated noise
    white: tuple[np.ndarray, ...]
    noise_scale: tuple[float, ...]  # of each clip, the errors' size over what is stated, as fitted
    # the residuals contradict the stated noise at the most: they look like noise of `noise_scale`,
    # and no tracker is so wrong about its own
    is_noise_misstated: bool
    # names of imperfections that are larger than such things usually are
    unusual: tuple[str, ...] = ()
    # why too little was seen to tell whether it is adequate; None where enough was
    no_verdict: str | None = None

    @property
    def is_adequate(self) -> bool:
        """Whether the data do not contradict the model, with imperfections of usual sizes."""
        return self.p_value >= ADEQUATE_P and not self.unusual


def comparison_document(comparison: Comparison) -> dict[str, Any]:
    """compare.json (docs/reference/result_files.md): all cells, nuisances outside their priors."""
    return {
        "adequate": comparison.is_adequate if comparison.no_verdict is None else None,
        "no_verdict": comparison.no_verdict,
        "p_value": comparison.p_value,
        "noise_scale": list(comparison.noise_scale),
        "noise_misstated": comparison.is_noise_misstated,
        "where": [asdict(place) for place in comparison.where],
        "pulls": [asdict(pull) for pull in pulled(comparison)],
        "error": dict(comparison.error),
    }


def pulled(comparison: Comparison) -> list[Pull]:
    """The nuisances outside their priors."""
    return [pull for pull in comparison.pulls if abs(pull.z) > PULLED_Z]


def compare(trials: JointProblem, fit: GradientFit, seed: int) -> Comparison:
    """Compares a fitted hypothesis with the data; the same seed gives the same result."""
    theta = trials.theta(fit.z, fit.free)
    fitted = np.array([trials.noise_scale(theta, c) for c in range(len(trials.problems))])
    judged_range = JUDGED_SCALE_RANGE
    if trials.sizes is not None:  # errors beyond the independent ones have sizes of their own
        judged_range = (min(float(fitted.min()), 1.0), JUDGED_SCALE_RANGE[1])
    scales = np.clip(fitted, *judged_range)
    measured = trials.whitened(theta[None], scales)
    sizes = [
        fitted_mode_size(white[0], scale, problem.data, problem.errors_in_full)
        for white, scale, problem in zip(measured, scales, trials.problems, strict=True)
    ]
    labels = [phases(each, trials.of_clip(theta, c)) for c, each in enumerate(trials.problems)]
    drawn = replicates(trials, fit, scales, sizes, labels, NUM_REPLICATES, seed)
    cells = _cells(trials, labels, scales)
    pulls = _pulls(trials, fit, theta)
    whitenings = [problem.data for problem in trials.problems]
    num_values = np.array([data.num_values for data in whitenings], dtype=float)
    used = fit.num_used * num_values / num_values.sum()

    def judged(bounds: tuple[float, float]) -> tuple[float, np.ndarray]:
        """The p-value and each cell's largest z, noise scales within bounds."""
        clips = list(zip(scales, used, whitenings, strict=True))
        own, others = (
            [_at_own_scale(w, *clip, bounds) for w, clip in zip(whites, clips, strict=True)]
            for whites in (measured, drawn)
        )
        return _p_value(own, others, cells, pulls)

    p, z = judged(judged_range)
    low, high = NOISE_SCALE_RANGE
    is_usual = low <= fitted.min() and fitted.max() <= high
    if p < ADEQUATE_P and not is_usual:
        p_free, z_free = judged(ANY_SCALE)
        p, z = (p_free, z_free) if p_free >= ADEQUATE_P else (p, z)
    white = [
        errors_at(own, scale[None], np.ones(1), data)[0]
        for own, scale, data in zip(measured, scales, whitenings, strict=True)
    ]
    predicted = trials.simulate(theta)
    places = [
        _place(trials.problems[cell.clip], predicted[cell.clip], white[cell.clip], cell, float(own))
        for cell, own in zip(cells, z, strict=True)
    ]
    return Comparison(
        p_value=p,
        where=tuple(sorted(places, key=lambda place: -place.z)),
        pulls=tuple(sorted(pulls, key=lambda pull: -abs(pull.z))),
        error=error_of(trials, theta, fit.num_fitted, fit.pull),
        labels=tuple(labels),
        white=tuple(
            w.reshape(p.observation.position_m.shape)
            for w, p in zip(white, trials.problems, strict=True)
        ),
        noise_scale=tuple(map(float, fitted)),
        is_noise_misstated=p >= ADEQUATE_P and not is_usual,
        unusual=() if fit.sizes is None else tuple(fit.sizes.unusual),
    )


def _cells(trials: JointProblem, labels: Sequence[np.ndarray], scales: np.ndarray) -> list[Cell]:
    """Where and when it is tested, but for cells most of whose errors the modes take up."""
    found = list[Cell]()
    for clip, (problem, label) in enumerate(zip(trials.problems, labels, strict=True)):
        absorbed = problem.data.absorbed(scales[clip])
        measured = is_measured(problem.data.inverse_root)
        every = find_cells(clip, problem.observation, measured, label)
        found += [cell for cell in every if absorbed[cell.index].mean() < ABSORBED]
    return found


def _at_own_scale(
    white: np.ndarray, scale: float, used: float, data: Whitening, bounds: tuple[float, float]
) -> np.ndarray:
    """Tracking errors `[point, value]` in units of their fitted size, within bounds.

    They were whitened at `scale`; `used` numbers' worth of the clip went into the parameters.
    """
    before = np.full(len(white), scale)
    after = fitted_noise_scale(white, before, np.full(len(white), used), NOISE_SD, data)
    return errors_at(white, before, np.clip(after, *bounds), data)


def _p_value(
    measured: list[np.ndarray], drawn: list[np.ndarray], cells: list[Cell], pulls: list[Pull]
) -> tuple[float, np.ndarray]:
    """Of all cells and pulls together; and each cell's largest statistic, `[cell]`, in sd."""
    of_cells = [_standardised(measured[c.clip], drawn[c.clip], c) for c in cells]
    p_local, p_pull = 1.0, 1.0
    if of_cells:
        # One row per replicate: its largest statistic of all cells.
        highest = np.max(np.concatenate([d for _, d in of_cells], axis=1), axis=1)
        p_local = _tail(max(float(m.max()) for m, _ in of_cells), highest)
    if pulls:
        p_pull = 2 * len(pulls) * float(ndtr(-max(abs(p.z) for p in pulls)))
    p = float(np.clip(min(p_local / (1 - PULL_SHARE), p_pull / PULL_SHARE), 0.0, 1.0))
    return p, np.array([float(own.max()) for own, _ in of_cells])


def _standardised(
    measured: np.ndarray, drawn: np.ndarray, cell: Cell
) -> tuple[np.ndarray, np.ndarray]:
    """A cell's statistics `[3]` and the replicates' `[replicate, 3]`, in standard deviations."""
    noise = drawn[:, cell.index]
    least = float(np.mean(np.sum(noise**2, axis=1)))
    together = float(np.mean(np.sum(noise[:, 1:] * noise[:, :-1], axis=1)))
    usual = (least, together / least if least > 0 else 0.0)
    found, expected = statistics(measured, cell, *usual)[0], statistics(drawn, cell, *usual)
    mean, sd = expected.mean(axis=0), expected.std(axis=0)
    sd = np.maximum(sd, 1e-9)
    return (found - mean) / sd, (expected - mean) / sd


def _tail(value: float, drawn: np.ndarray) -> float:
    """How likely a draw is as large as `value`."""
    counted = (1 + np.sum(drawn >= value)) / (1 + len(drawn))
    if counted > 5 / len(drawn):
        return float(counted)
    scale = np.sqrt(6) / np.pi * drawn.std()
    # Of a Gumbel distribution with the draws' mean and spread.
    return float(-np.expm1(-np.exp(-((value - drawn.mean()) / scale + np.euler_gamma))))


def _pulls(trials: JointProblem, fit: GradientFit, theta: np.ndarray) -> list[Pull]:
    """All nuisances but the noise scale, which residuals judge."""
    parameters = trials.model_parameters
    z = prior_deviations(parameters, fit.z[: len(parameters)])
    return [
        Pull(parameter.name, float(theta[i]), parameter.unit, float(z[i]))
        for i, parameter in enumerate(parameters)
        if parameter.role == "nuisance" and fit.free[i]
    ]


def _place(
    problem: Problem, predicted_m: np.ndarray, white: np.ndarray, cell: Cell, z: float
) -> Place:
    observation = problem.observation
    i, a = observation.names.index(cell.object), observation.axes.index(cell.axis)
    index = cell.index % len(observation.times_s)
    steps = index[:-1][np.diff(index) == 1]
    speed, noise = (v[i, a, steps] for v in velocity_residuals(observation, predicted_m))
    left = white[cell.index]
    neighbours = float(np.sum(left[1:] * left[:-1]) / max(np.sum(left**2), 1e-12))
    return Place(
        clip=problem.name,
        object=cell.object,
        axis=cell.axis,
        phase=cell.phase,
        rmse=float(np.sqrt(np.mean(speed**2))) if speed.size else 0.0,
        noise=float(np.sqrt(np.mean(noise))) if noise.size else 0.0,
        z=z,
        whiteness=neighbours,
    )

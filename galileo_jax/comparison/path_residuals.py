"""Each object's motion along its path, measured and fitted, and the residuals."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.comparison.compare import Comparison, Place, pulled
from galileo_jax.comparison.local_tests import WHOLE
from galileo_jax.comparison.phases import PHASES, Phase, phases_of
from galileo_jax.inference.fit_posterior import fit_posterior
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem

NUM_DRAWS = 60
FEWEST = 3  # values in an interval
MARKED_Z = 3.0  # below it a cell is no place where the model fails


@dataclass(frozen=True)
class PathResiduals:
    """One object of one clip; arrays are `[frame]`."""

    # names of the clip and of the object
    clip: str
    name: str
    title: str  # of a picture: the object, and its clip where there are several
    index: int  # of the object
    times_s: np.ndarray  # of the frames
    # along the path, NaN where it was not tracked; 0 at the foot (incline: the start); without the
    # constant offset of the tracked point
    measured_m: np.ndarray
    predicted_m: np.ndarray  # of the fit
    # where 95 % of the posterior's draws are
    low_m: np.ndarray
    high_m: np.ndarray
    # tracking errors that the fit leaves, along the path and across it, in units of the stated
    # noise
    along: np.ndarray
    across: np.ndarray
    phases: tuple[Phase, ...]  # of the motion
    # the interval in which the model fails worst, None where it does not fail
    failing_s: tuple[float, float] | None
    worst: Place | None  # the cell of that interval

    @property
    def largest(self) -> float:
        """The largest residual, in units of the noise."""
        return float(np.nanmax(np.abs([self.along, self.across]), initial=0.0))


def path_residuals(
    trials: JointProblem, fit: GradientFit, comparison: Comparison, seed: int
) -> tuple[PathResiduals, ...]:
    """All objects of all clips."""
    drawn = fit_posterior(trials, fit, seed).flat()
    drawn = drawn[np.random.default_rng(seed).choice(len(drawn), NUM_DRAWS, replace=False)]
    theta = trials.theta(fit.z, fit.free)
    found = []
    for clip, best in enumerate(trials.simulate(theta)):
        problem = trials.problems[clip]
        draws = problem.simulate_batch(trials.of_clip(drawn, clip))
        draws = draws[np.isfinite(draws).all(axis=(1, 2, 3))]
        for i, name in enumerate(problem.observation.names):
            title = name if len(trials.problems) == 1 else f"{problem.name}, {name}"
            found.append(_object(problem, i, best, draws, clip, comparison, title))
    return tuple(found)


def _object(
    problem: Problem,
    index: int,
    best: np.ndarray,
    draws: np.ndarray,
    clip: int,
    comparison: Comparison,
    title: str,
) -> PathResiduals:
    observation = problem.observation
    is_tracked, times = observation.mask[index], observation.times_s
    tangent = _tangent(problem, index, best[index])
    difference = np.where(is_tracked, observation.position_m[index] - best[index], np.nan)
    offset = np.nanmedian(difference, axis=1) if is_tracked.any() else np.zeros(len(difference))
    path = _path(problem, index, best[index], tangent)
    moved = np.einsum("at,bat->bt", tangent, draws[:, index] - best[index])
    # Each draw, like the fit, up to the constant offset of the tracked point.
    moved = moved - np.median(moved, axis=1, keepdims=True)
    low, high = np.quantile(moved, [0.025, 0.975], axis=0) if len(moved) else (0 * path, 0 * path)
    white = np.where(is_tracked, comparison.white[clip][index], np.nan)
    normal = np.stack([-tangent[1], tangent[0], *tangent[2:]])
    labels = comparison.labels[clip][index]
    worst, failing = _worst(comparison, problem.name, observation.names[index]), None
    if worst is not None:
        own = white[observation.axes.index(worst.axis)]
        failing = failing_interval(own, labels, times, worst.phase)
    return PathResiduals(
        clip=problem.name,
        name=observation.names[index],
        title=title,
        index=index,
        times_s=times,
        measured_m=path + np.sum(tangent * (difference - offset[:, None]), axis=0),
        predicted_m=path,
        low_m=path + low,
        high_m=path + high,
        along=np.sum(tangent * white, axis=0),
        across=np.sum(normal * white, axis=0),
        phases=phases_of(labels, times),
        failing_s=failing,
        worst=worst,
    )


def failing_interval(
    white: np.ndarray, labels: np.ndarray, times_s: np.ndarray, phase: str
) -> tuple[float, float] | None:
    """When the residuals of a cell deviate most, to one side: the window of largest |sum| / sqrt n.

    `white` is `[frame]`, NaN where nothing was tracked; `labels` are indices into `PHASES`.
    """
    if phase != WHOLE:
        white = np.where(labels == PHASES.index(phase), white, np.nan)
    found = worst_interval(white, times_s)
    return None if found is None else (found.start_s, found.end_s)


def _tangent(problem: Problem, index: int, centre_m: np.ndarray) -> np.ndarray:
    """The path's direction at `centre_m` `[axis, frame]`, as declared; across it z is not shown."""
    scene = problem.model.scene.surroundings
    is_on_ramp = centre_m[0] < scene.corner_m[index]  # always, without a table
    slope = np.where(is_on_ramp, scene.angle_rad, 0.0)
    return np.stack([np.cos(slope), -np.sin(slope), *np.zeros_like(centre_m[2:])])


def _path(problem: Problem, index: int, centre_m: np.ndarray, tangent: np.ndarray) -> np.ndarray:
    scene = problem.model.scene.surroundings
    if scene.has_table:
        origin = np.array([scene.corner_m[index], scene.half_height_m[index]])
    else:
        origin = np.array(scene.start_m[index])
    return np.sum(tangent * (centre_m - origin[:, None]), axis=0)


def _worst(comparison: Comparison, clip: str, name: str) -> Place | None:
    """The object's worst cell, where the model fails there.

    The worst of all is marked however bad it is, unless it is a nuisance that fails.
    """
    if comparison.is_adequate:
        return None
    first = () if pulled(comparison) else comparison.where[:1]
    marked = [p for p in comparison.where if p.z > MARKED_Z or p in first]
    own = [p for p in marked if (p.clip, p.object) == (clip, name)]
    return own[0] if own else None


@dataclass(frozen=True)
class Interval:
    """Of residuals: when, and |sum| / sqrt(number), in units of the noise."""

    start_s: float
    end_s: float
    z: float


def worst_interval(values: np.ndarray, times_s: np.ndarray) -> Interval | None:
    """The interval of largest |sum| / sqrt(number).

    `values` `[frame]` are N(0, 1) where the model is right; NaN is left out. None with fewer than
    three values. White noise gives a z of about 3.0 for 120 values.
    """
    known = np.isfinite(values)
    if known.sum() < FEWEST:
        return None
    sums, times = np.concatenate([[0.0], np.cumsum(values[known])]), times_s[known]
    first, last = np.triu_indices(len(sums), FEWEST)
    strength = np.abs(sums[last] - sums[first]) / np.sqrt(last - first)
    best = int(np.argmax(strength))
    return Interval(float(times[first[best]]), float(times[last[best] - 1]), float(strength[best]))

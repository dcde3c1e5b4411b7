"""The gradient fit of one hypothesis and a free acceleration of every object beside it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.diagnosis.free_force.spans import spans_of
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.free_acceleration import FreeAcceleration, Span
from galileo_jax.rollout.engines import make_engine
from galileo_jax.search.fit import refit

# What friction takes up of a constant force is a soft direction: it must be followed to its end.
SETTLED_NATS = 0.005
NUM_SPANS = 2  # pieces by the hypothesis, then by the fit with the acceleration


@dataclass(frozen=True)
class FreeFit:
    """A mode and the normal approximation round it.

    Attributes:
      trials: with the free acceleration among what is always there.
      effects: the free acceleration of each clip.
      fit: of all parameters.
      residual: `[value]`, whitened at the fitted noise scales.
    """

    trials: JointProblem
    effects: tuple[FreeAcceleration, ...]
    fit: GradientFit
    residual: np.ndarray


def with_free_acceleration(problem: Problem, spans_s: Sequence[Sequence[Span]]) -> Problem:
    """The problem with a free acceleration of every object among what is always there."""
    spans = tuple(tuple((begin, end) for begin, end in own) for own in spans_s)
    effect = FreeAcceleration(spans)
    always = (e for e in problem.model.nuisances if not isinstance(e, FreeAcceleration))
    model = replace(problem.model, nuisances=(*always, effect))
    return replace(problem, model=model, engine=make_engine(problem.engine.name, model))


def free_acceleration_of(problem: Problem) -> FreeAcceleration:
    """That of a problem which has one."""
    return next(e for e in problem.model.nuisances if isinstance(e, FreeAcceleration))


def free_fit(
    trials: JointProblem, z: np.ndarray, free: np.ndarray, num_spans: int = NUM_SPANS
) -> FreeFit:
    """Fits a hypothesis once more, with a free acceleration of every object.

    Args:
      trials: clips, each of which gets an acceleration of its own.
      z: `[parameter]`, of the hypothesis' fit, noise scales last.
      free: `[parameter]`, which parameters the hypothesis has.
      num_spans: how often the pieces are made, first by the hypothesis, then by the last fit.
    """
    extended, theta = trials, trials.theta(z, free)
    for again in range(num_spans):
        problems = []
        for clip, problem in enumerate(extended.problems):
            spans = spans_of(problem, extended.of_clip(theta, clip))
            problems.append(with_free_acceleration(problem, spans))
        extended = JointProblem(tuple(problems))
        is_last = again == num_spans - 1
        found = _fitted(extended, embedded(trials, extended, z, free), in_all_valleys=is_last)
        theta = extended.theta(found.fit.z, found.fit.free)
    return found


def embedded(
    trials: JointProblem, extended: JointProblem, z: np.ndarray, free: np.ndarray
) -> np.ndarray:
    """A hypothesis' z among the parameters of the extended trials; NaN where it pins one."""
    start = np.where(extended.free(()), 0.0, np.nan)
    start[[extended.names.index(name) for name in trials.names]] = np.where(free, z, np.nan)
    return start


def _fitted(extended: JointProblem, start: np.ndarray, in_all_valleys: bool) -> FreeFit:
    """The fit from a start `[parameter]`, z; NaN where pinned."""
    fitter, count = GradientFitter(extended, SETTLED_NATS), len(extended.model_parameters)
    own = start[None, :count]
    [fit] = fitter.fit_from(np.nan_to_num(own), np.isfinite(own), np.zeros(1, int))
    if in_all_valleys:  # the start is of a wrong model, whose restitution may be in another one
        fit = refit(fitter, fit)
    theta = extended.theta(fit.z, fit.free)
    residual = [
        problem.whiten(
            problem.simulate(extended.of_clip(theta, clip)), extended.noise_scale(theta, clip)
        )
        for clip, problem in enumerate(extended.problems)
    ]
    effects = tuple(free_acceleration_of(problem) for problem in extended.problems)
    return FreeFit(extended, effects, fit, np.concatenate(residual))

"""The acceleration that no effect explains, inferred without a form.

    1. The hypothesis and a smooth acceleration of every object (`FreeAcceleration`) are fitted
       together, from the hypothesis' fit.
    2. A constant acceleration is equivalent to slightly less friction, and the data cannot
       separate the two. Therefore the spline itself is not reported, but the difference between
       the accelerations of the complete model and of the hypothesis' own fit along the fitted
       motion, which the data do determine.
    3. The hypothesis is the model without effects, or all that the best formula (`laws`) has
       beside it, where that explains the data: friction and all else are then where they are
       with the formula, and an acceleration of -0.6 v|v| is 0 at rest, not what friction without
       it had made up for.

Clips of a series are taken one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from galileo_jax.diagnosis.diagnosis import MissingForce
from galileo_jax.diagnosis.free_force.along_path import along_path
from galileo_jax.diagnosis.free_force.free_fit import free_fit
from galileo_jax.diagnosis.free_force.spans import MOVES_M_S
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.free_acceleration import FreeAcceleration
from galileo_jax.model.model import Model
from galileo_jax.rollout.motion import dynamics, state_at
from galileo_jax.search.hypothesis import Hypothesis

NUM_TIMES, NUM_DRAWS = 200, 400


def views_of(trials: JointProblem, *starts: Hypothesis) -> list["View"]:
    """Each clip fitted with a free acceleration, from where it comes to the better valley.

    An acceleration of any form leaves little wherever its fit starts, but friction that is far off
    there may stay so: objects rest that are seen to move, or the acceleration undoes what friction
    does, and nothing that is linear round such a fit reaches the truth.

    Args:
      trials: what was diagnosed.
      starts: hypotheses of the same effects.
    """
    return [
        max(
            (view_of(trials, hypothesis, clip) for hypothesis in starts),
            key=lambda view: view.fit.log_evidence,
        )
        for clip in range(len(trials.problems))
    ]


def infer_missing_force(
    trials: JointProblem,
    hypothesis: Hypothesis,
    seed: int,
    views: Sequence["View"] | None = None,
) -> MissingForce:
    """Infers the acceleration along the path that acts beyond what a hypothesis has.

    Args:
      trials: what was diagnosed.
      hypothesis: fitted to them. Its effects, if it has any, count as missing: of a formula that
        explains the data all else stays.
      seed: of the posteriors' draws.
      views: from `views_of`, where they are there already, of whatever hypothesis.

    Returns:
      The first clip's, NaN where an object is at rest or not seen.
    """
    view = views[0] if views else view_of(trials, hypothesis, 0)
    acceleration, sd = _beyond(view, trials, hypothesis, np.random.default_rng([seed, 61]))
    return MissingForce(
        time_s=view.time_s,
        acceleration_m_s2=np.where(view.moves, acceleration, np.nan),
        sd_m_s2=np.where(view.moves, sd, np.nan),
        path_m=view.path_m,
        speed_m_s=view.speed_m_s,
    )


@dataclass(frozen=True)
class View:
    """One clip fitted with a free acceleration.

    Attributes:
      trials: the clip alone, its model with the free acceleration.
      fit: with the free acceleration.
      residual: `[value]`, whitened at the fitted noise scales.
      effect: the free acceleration.
      time_s: `[time]`.
      path_m, speed_m_s: `[object, time]`, of the fit.
      moves: `[object, time]`, whether it is seen to move.
    """

    trials: JointProblem
    fit: GradientFit
    residual: np.ndarray
    effect: FreeAcceleration
    time_s: np.ndarray
    path_m: np.ndarray
    speed_m_s: np.ndarray
    moves: np.ndarray

    @property
    def model(self) -> Model:
        """With the free acceleration."""
        return self.trials.problems[0].model

    @property
    def start_path_m(self) -> np.ndarray:
        """Where each object's motion begins, along its path, `[object]`."""
        return np.asarray(self.model.scene.surroundings.start_path_m)

    @property
    def free(self) -> np.ndarray:
        """Of the model's parameters."""
        return self.fit.free[: len(self.model.names)]

    def knots(self, index: int) -> np.ndarray:
        """Where an object's knots stand."""
        return np.array([self.model.index(name) for name in self.effect.knots(index)])

    def others(self) -> np.ndarray:
        """Where all stand that are free and no knots."""
        own = np.concatenate([self.knots(i) for i in range(len(self.path_m))])
        return np.setdiff1d(np.flatnonzero(self.free), own)

    def target(self) -> np.ndarray:
        """The residuals, linear in all parameters, where these are all in their middle."""
        jacobian = self.fit.jacobian
        return self.residual - jacobian @ np.where(self.free, self.fit.z[: jacobian.shape[1]], 0)

    def shows(self, index: int) -> np.ndarray:
        """How an object's acceleration shows in the target, `[value, time]`."""
        identity = np.eye(len(self.time_s))
        inside = self.moves[index]
        weights = self.effect.knot_values(self.time_s[inside], identity[inside], index)
        return -self.fit.jacobian[:, self.knots(index)] @ weights


def view_of(trials: JointProblem, hypothesis: Hypothesis, clip: int) -> View:
    """Fits one clip with a free acceleration."""
    # A formula is judged in a linear model, some way from the truth: what a camera may bend is
    # allowed for, whoever measured, so that a bend of the model is not taken for a force.
    problem = replace(trials.problems[clip], noise="camera")
    column = trials.columns_of(clip)
    z, free = hypothesis.fit.z[column], hypothesis.fit.free[column]
    found = free_fit(JointProblem((problem,)), z, free)
    extended, fit, (effect,) = found.trials, found.fit, found.effects
    theta = extended.theta(fit.z, fit.free)
    time_s, path, speed = _motion(
        extended.problems[0], theta[:-1], max(own[-1][1] for own in effect.spans_s)
    )
    moves = _seen(problem, time_s) & (np.abs(speed) > MOVES_M_S)
    for i, own in enumerate(effect.spans_s):
        moves[i] &= (time_s >= own[0][0]) & (time_s <= own[-1][1])
    return View(extended, fit, found.residual, effect, time_s, path, speed, moves)


def _motion(
    problem: Problem, theta: np.ndarray, end_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times `[time]`, and path and speed `[object, time]` of a rollout."""
    recorded, path, speed = along_path(problem, theta)
    chosen = np.unique(np.linspace(0, np.searchsorted(recorded, end_s), NUM_TIMES).astype(int))
    chosen = chosen[chosen < len(recorded)]
    return recorded[chosen], path[:, chosen], speed[:, chosen]


def _seen(problem: Problem, time_s: np.ndarray) -> np.ndarray:
    """Whether each object has been seen before and is seen again, `[object, time]`."""
    times = np.asarray(problem.observation.times_s)
    frames = [times[mask] for mask in problem.observation.mask]
    return np.stack(
        [(time_s >= own[0]) & (time_s <= own[-1]) if own.size else time_s < 0 for own in frames]
    )


def _beyond(
    view: View, trials: JointProblem, hypothesis: Hypothesis, generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The acceleration over the hypothesis without its effects, and its sd, `[object, time]`."""
    fit = view.fit
    with_knots = np.tile(fit.z, (NUM_DRAWS, 1))
    with_knots[:, :-1] = generator.multivariate_normal(
        fit.z[:-1], fit.covariance[:-1, :-1], NUM_DRAWS, method="svd"
    )
    without = _without_effects(view, hypothesis.of(trials), hypothesis, generator)
    missing = _accelerations(view, view.trials.theta(with_knots, fit.free))
    missing -= _accelerations(view, view.trials.theta(without, fit.free))
    return missing.mean(axis=0), missing.std(axis=0)


def _without_effects(
    view: View, own: JointProblem, hypothesis: Hypothesis, generator: np.random.Generator
) -> np.ndarray:
    """Draws of the first clip's parameters without effects, `[draw, parameter]`.

    Args:
      view: whose parameters, z.
      own: whose parameters the hypothesis has.
      hypothesis: fitted to them.
      generator: of the draws.
    """
    fit, names = hypothesis.fit, view.trials.names
    draws = generator.multivariate_normal(fit.z, fit.covariance, NUM_DRAWS, method="svd")
    z = np.zeros((NUM_DRAWS, len(names)))
    for at, name in zip(own.columns_of(0), own.alone(0).names, strict=True):
        if own.free(())[at]:
            z[:, names.index(name)] = draws[:, at]
    return z


def _accelerations(view: View, theta: np.ndarray) -> np.ndarray:
    """Of a model along the fitted motion, `[draw, parameter]` to `[draw, object, time]`, m/s^2."""
    model = view.model
    scene = model.scene.surroundings
    law = dynamics(model.effects + model.nuisances, scene, model.by_name(theta), np)
    found = []
    for time, path, speed in zip(view.time_s, view.path_m.T, view.speed_m_s.T, strict=True):
        state = state_at(path[None], speed[None], np.asarray(time), scene)
        found.append((law.drive(state) - np.sign(speed) * law.brake(state)) / law.inertia)
    return np.stack(found, axis=-1)

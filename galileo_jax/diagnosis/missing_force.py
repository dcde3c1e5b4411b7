"""The acceleration that no effect explains, inferred without a form.

    1. The hypothesis and a smooth acceleration of every object (`FreeAcceleration`) are fitted
       together, from the hypothesis' fit.
    2. A constant acceleration is equivalent to slightly less friction, and the data cannot
       separate the two. Therefore the spline itself is not reported, but the difference between
       the accelerations of the complete model and of the hypothesis' own fit along the fitted
       motion, which the data do determine.
    3. A formula is sought that together with the hypothesis explains the data (`formula`). If
       there is one, friction and all else are put where they are with it, and the acceleration
       is told over these: -0.6 v|v| is then 0 at rest, and not negative or positive by what
       the hypothesis' friction had made up for.

Clips of a series are taken one by one; the formula is the same in all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import cho_factor, cho_solve, solve_triangular

from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import MissingForce
from galileo_jax.diagnosis.formula import NOT_SIMPLE, Formula, Sight, find_formula
from galileo_jax.inference.free_force.along_path import along_path
from galileo_jax.inference.free_force.free_fit import FreeFit, embedded, free_fit
from galileo_jax.inference.free_force.spans import MOVES_M_S
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.free_acceleration import FreeAcceleration
from galileo_jax.model.model import Model
from galileo_jax.rollout.motion import dynamics, state_at

NUM_TIMES, NUM_DRAWS = 200, 400


def views_of(trials: JointProblem, hypothesis: Hypothesis) -> list["View"]:
    """Each clip fitted with a free acceleration beside a hypothesis."""
    return [view_of(trials, hypothesis, clip) for clip in range(len(trials.problems))]


def infer_missing_force(
    trials: JointProblem,
    hypothesis: Hypothesis,
    seed: int,
    views: Sequence["View"] | None = None,
) -> MissingForce:
    """Infers the acceleration along the path that a hypothesis lacks, and a formula for it.

    Args:
      trials: whose models have the hypothesis' effects.
      hypothesis: fitted to them.
      seed: of the posterior's draws.
      views: from `views_of`, where they are there already, of whatever hypothesis.

    Returns:
      The first clip's, NaN where an object is at rest or not seen. Its zero is the hypothesis
      with friction, masses and nuisances where the formula has them; where no formula was
      found for what is missing, the hypothesis' fit itself. The formula is that of all clips,
      and so is the share it explains: of the misfit that an acceleration of any form takes
      away.
    """
    views = views or views_of(trials, hypothesis)
    alone = JointProblem((trials.problems[0],))
    column, fit = trials.columns_of(0), hypothesis.fit
    before = embedded(alone, views[0].trials, fit.z[column], fit.free[column])
    views = [replace(views[0], before=np.nan_to_num(before)), *views[1:]]
    count = len(views[0].path_m)
    formulas = [find_formula([_sight(view, i) for view in views]) for i in range(count)]
    first = views[0]
    acceleration, sd = _told(first, formulas, np.random.default_rng([seed, 61]))
    return MissingForce(
        time_s=first.time_s,
        acceleration_m_s2=np.where(first.moves, acceleration, np.nan),
        sd_m_s2=np.where(first.moves, sd, np.nan),
        path_m=first.path_m,
        speed_m_s=first.speed_m_s,
        formula=tuple(f"a{i + 1} = {formula.text}" for i, formula in enumerate(formulas)),
        share_explained=tuple(formula.share_explained for formula in formulas),
    )


@dataclass(frozen=True)
class View:
    """One clip fitted with a free acceleration.

    Attributes:
      trials: the clip alone, its model with the free acceleration.
      before: `[parameter]`, z of the hypothesis, no acceleration.
      fit: with the free acceleration.
      effect: the free acceleration.
      time_s: `[time]`.
      path_m, speed_m_s: `[object, time]`, of the fit.
      moves: `[object, time]`, whether it is seen to move.
    """

    trials: JointProblem
    before: np.ndarray
    fit: FreeFit
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
        return self.fit.residual - jacobian @ np.where(
            self.free, self.fit.z[: jacobian.shape[1]], 0
        )

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
    fit = free_fit(JointProblem((problem,)), z, free)
    extended = fit.trials
    (effect,) = fit.effects
    theta = extended.theta(fit.z, fit.free)
    time_s, path, speed = _motion(
        extended.problems[0], theta[:-1], max(own[-1][1] for own in effect.spans_s)
    )
    moves = _seen(problem, time_s) & (np.abs(speed) > MOVES_M_S)
    for i, own in enumerate(effect.spans_s):
        moves[i] &= (time_s >= own[0][0]) & (time_s <= own[-1][1])
    return View(extended, fit.start, fit, effect, time_s, path, speed, moves)


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


def _sight(view: View, index: int) -> Sight:
    """What a clip says of one object's acceleration, all that else is unknown taken out.

    The prior of the rest, unit normal in z, makes the target's covariance  S = 1 + N N'.
    """
    jacobian = view.fit.jacobian
    own = view.knots(index)
    rest = jacobian[:, np.setdiff1d(np.flatnonzero(view.free), own)]
    target = view.target()
    lower = np.linalg.cholesky(np.eye(len(target)) + rest @ rest.T)
    white = solve_triangular(lower, target, lower=True)
    free = solve_triangular(lower, jacobian[:, own], lower=True)
    normal = np.eye(len(own)) + free.T @ free
    pulled = free.T @ white
    gain = float(pulled @ cho_solve(cho_factor(normal), pulled))
    inside = view.moves[index]
    return Sight(
        time_s=view.time_s[inside],
        path_m=view.path_m[index, inside],
        speed_m_s=view.speed_m_s[index, inside],
        target=white,
        response=solve_triangular(lower, view.shows(index)[:, inside], lower=True),
        free_chi2=float(white @ white) - gain,
        log_evidence=0.5 * (gain - float(np.linalg.slogdet(normal)[1])),
    )


def _told(
    view: View, formulas: Sequence[Formula], generator: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """The acceleration over the model that goes with the formulas and its sd, `[object, time]`."""
    fit, trials = view.fit, view.trials
    with_knots = np.tile(fit.z, (NUM_DRAWS, 1))
    with_knots[:, :-1] = generator.multivariate_normal(
        fit.z[:-1], fit.covariance[:-1, :-1], NUM_DRAWS, method="svd"
    )
    whole = _accelerations(view, trials.theta(with_knots, fit.free))
    base = _accelerations(view, trials.theta(_bases(view, formulas, generator), fit.free))
    held = _accelerations(view, trials.theta(view.before[None], fit.free))
    is_explained = np.array([formula.text != NOT_SIMPLE for formula in formulas])
    missing = whole - np.where(is_explained[:, None], base, held)
    return missing.mean(axis=0), missing.std(axis=0)


def _bases(view: View, formulas: Sequence[Formula], generator: np.random.Generator) -> np.ndarray:
    """Draws of all but the knots with the formulas in the model, `[draw, parameter]`, z.

    Coefficients of formulas are free. An object without one keeps its free acceleration.
    """
    jacobian = view.fit.jacobian
    others = view.others()
    columns, precision = [-jacobian[:, others]], [np.ones(len(others))]
    for i, formula in enumerate(formulas):
        inside = view.moves[i]
        place = view.time_s[inside], view.path_m[i, inside], view.speed_m_s[i, inside]
        shows = view.shows(i)[:, inside]
        for term in formula.terms:
            columns.append((shows @ term.curve(*place))[:, None])
            precision.append(np.full(1, 1e-6))
        if formula.text == NOT_SIMPLE:
            columns.append(-jacobian[:, view.knots(i)])
            precision.append(np.ones(columns[-1].shape[1]))
    design = np.concatenate(columns, axis=1)
    covariance = np.linalg.inv(design.T @ design + np.diag(np.concatenate(precision)))
    mean = covariance @ design.T @ view.target()
    draws = generator.multivariate_normal(mean, covariance, NUM_DRAWS, method="svd")
    z = np.tile(view.before, (NUM_DRAWS, 1))
    z[:, others] = draws[:, : len(others)]
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

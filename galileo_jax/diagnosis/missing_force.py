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
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.free_acceleration import FreeAcceleration, Span
from galileo_jax.model.model import Model
from galileo_jax.rollout.engines import make_engine
from galileo_jax.rollout.motion import dynamics, state_at
from galileo_jax.search.fit import refit
from galileo_jax.search.hypothesis import Hypothesis

NUM_TIMES, NUM_DRAWS = 200, 400
# What friction takes up of a constant force is a soft direction: it must be followed to its end.
SETTLED_NATS = 0.005
MOVES_M_S = 0.01
LONGER = 1.05  # than the hypothesis says, the objects may move
SHORTEST_S = 0.05  # of a piece


def views_of(trials: JointProblem, *starts: Hypothesis) -> list["View"]:
    """Each clip fitted with a free acceleration, from where it comes to the better valley.

    An acceleration of any form leaves little wherever its fit starts, but friction that is far off
    there may stay so: objects rest that are seen to move, or the acceleration undoes what friction
    does, and nothing that is linear round such a fit reaches the truth.
    """
    return [
        max(
            (view_of(trials, hypothesis, clip) for hypothesis in starts),
            key=lambda view: view.fit.log_evidence,
        )
        for clip in range(len(trials.problems))
    ]


def infer_missing_force(
    trials: JointProblem, hypothesis: Hypothesis, seed: int, views: Sequence["View"] | None = None
) -> MissingForce:
    """The acceleration along the path that acts beyond what a hypothesis has, of the first clip.

    NaN where an object is at rest or not seen. The effects of the hypothesis, if it has any, count
    as missing: of a formula that explains the data all else stays. `views`: from `views_of`, where
    they are there already, of whatever hypothesis.
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
    """One clip fitted with a free acceleration."""

    trials: JointProblem  # the clip alone, its model with the free acceleration
    fit: GradientFit  # with the free acceleration
    residual: np.ndarray  # `[value]`, whitened at the fitted noise scales
    effect: FreeAcceleration
    time_s: np.ndarray  # `[time]`
    # `[object, time]`, of the fit
    path_m: np.ndarray
    speed_m_s: np.ndarray
    moves: np.ndarray  # `[object, time]`, whether it is seen to move

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
    """Fits one clip with a free acceleration of every object, from a hypothesis' fit.

    Twice: its pieces of time are made by the hypothesis, then by the first such fit.
    """
    # A formula is judged in a linear model, some way from the truth: what a camera may bend is
    # allowed for, whoever measured, so that a bend of the model is not taken for a force.
    problem = replace(trials.problems[clip], noise="camera")
    column = trials.columns_of(clip)
    z, free = hypothesis.fit.z[column], hypothesis.fit.free[column]
    extended = own = JointProblem((problem,))
    theta = own.theta(z, free)
    for is_last in (False, True):
        (before,) = extended.problems
        made = _with_free_acceleration(before, _spans_of(before, extended.of_clip(theta, 0)))
        extended = JointProblem((made,))
        start = np.where(extended.free(()), 0.0, np.nan)
        start[extended.places(own.names)] = np.where(free, z, np.nan)
        fit = _fitted(extended, start, in_all_valleys=is_last)
        theta = extended.theta(fit.z, fit.free)
    (seen,) = extended.problems
    predicted = seen.simulate(extended.of_clip(theta, 0))
    residual = seen.whiten(predicted, extended.noise_scale(theta, 0))
    effect = next(e for e in seen.model.nuisances if isinstance(e, FreeAcceleration))
    end_s = max(own[-1][1] for own in effect.spans_s)
    time_s, path, speed = _motion(seen, extended.of_clip(theta, 0), end_s)
    moves = _seen(problem, time_s) & (np.abs(speed) > MOVES_M_S)
    for i, spans in enumerate(effect.spans_s):
        moves[i] &= (time_s >= spans[0][0]) & (time_s <= spans[-1][1])
    return View(extended, fit, residual, effect, time_s, path, speed, moves)


def _with_free_acceleration(problem: Problem, spans_s: Sequence[Sequence[Span]]) -> Problem:
    """The problem with a free acceleration of every object among what is always there."""
    spans = tuple(tuple((begin, end) for begin, end in own) for own in spans_s)
    always = (e for e in problem.model.nuisances if not isinstance(e, FreeAcceleration))
    model = replace(problem.model, nuisances=(*always, FreeAcceleration(spans)))
    return replace(problem, model=model, engine=make_engine(problem.engine.name, model))


def _fitted(extended: JointProblem, start: np.ndarray, in_all_valleys: bool) -> GradientFit:
    """The fit from a start `[parameter]`, z; NaN where pinned."""
    fitter, count = GradientFitter(extended, SETTLED_NATS), len(extended.model_parameters)
    own = start[None, :count]
    [fit] = fitter.fit_from(np.nan_to_num(own), np.isfinite(own), np.zeros(1, int))
    # The start is of a wrong model, whose restitution may be in another valley.
    return refit(fitter, fit) if in_all_valleys else fit


def _spans_of(problem: Problem, theta: np.ndarray) -> tuple[tuple[Span, ...], ...]:
    """When each object moves by a rollout, in pieces; all the time where it says never.

    Object 1 has a piece on the ramp, one on the table, and one from when object 2 begins to
    move.
    """
    last = float(problem.observation.times_s[-1])
    position, velocity = problem.engine.simulate(theta[None])
    times = np.arange(velocity.shape[-1]) * problem.model.record_dt_s
    scene = problem.model.scene.surroundings
    speeds = np.linalg.norm(velocity[0], axis=1)
    moved = np.linalg.norm(position[0] - position[0, ..., :1], axis=1)
    found = []
    for way, speed in zip(moved, speeds, strict=True):
        moving = np.flatnonzero((speed > MOVES_M_S) & (times <= last))
        begin, end = (moving[0], moving[-1]) if moving.size > 2 else (0, len(times) - 1)
        # Records are 4 ms apart; a knock is in between.
        since = min(way[begin] / max(speed[begin], MOVES_M_S), times[1])
        start = max(float(times[begin] - since), 0.0)
        found.append((start, float(min(last, start + LONGER * (times[end] - start)))))
    (begin, end), *others = found
    events = [start for start, _ in others]
    beyond = position[0, 0, 0] - scene.corner_m[0]
    if scene.comes_down[0] and (beyond >= 0).any():
        reached = int(np.argmax(beyond >= 0))
        pair = slice(max(reached - 1, 0), reached + 1)
        events.append(float(np.interp(0.0, beyond[pair], times[pair])))
    edges = [begin]
    for event in sorted(events):
        if event > edges[-1] + SHORTEST_S and end > event + SHORTEST_S:
            edges.append(event)
    pieces = tuple(zip(edges, [*edges[1:], end], strict=True))
    return (pieces, *((span,) for span in others))


def _along_path(problem: Problem, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times `[record]`, s; path (m) and speed (m/s) `[object, record]` of a rollout."""
    model = problem.model
    scene = model.scene.surroundings
    position, velocity = (values[0] for values in problem.engine.simulate(theta[None]))
    law = dynamics(model.effects + model.nuisances, scene, model.by_name(theta[None]), np)
    if scene.has_table:
        corner = np.asarray(scene.corner_m)
        origin = np.stack([corner, np.asarray(scene.half_height_m)], axis=1)
        slope = np.where(position[:, 0] < corner[:, None], law.ramp_rad, law.table_rad)
    else:
        origin = np.asarray(scene.start_m)
        slope = np.broadcast_to(law.ramp_rad, position[:, 0].shape)
    tangent = np.stack([np.cos(slope), -np.sin(slope)], axis=1)
    if not scene.moves_in_plane:
        path = np.sum((position - origin[..., None]) * tangent, axis=1)
        speed = np.sum(velocity * tangent, axis=1)
    else:
        speed = np.linalg.norm(velocity, axis=1)
        steps = np.linalg.norm(np.diff(position, axis=-1), axis=1)
        path = np.pad(np.cumsum(steps, axis=-1), [(0, 0), (1, 0)])
    return np.arange(path.shape[-1]) * model.record_dt_s, path, speed


def _motion(
    problem: Problem, theta: np.ndarray, end_s: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times `[time]`, and path and speed `[object, time]` of a rollout."""
    recorded, path, speed = _along_path(problem, theta)
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
    """Draws of the first clip's parameters without effects, `[draw, parameter]`."""
    fit, column = hypothesis.fit, own.columns_of(0)
    draws = generator.multivariate_normal(fit.z, fit.covariance, NUM_DRAWS, method="svd")
    z, kept = np.zeros((NUM_DRAWS, len(view.trials.names))), own.free(())[column]
    z[:, view.trials.places(own.alone(0).names)[kept]] = draws[:, column[kept]]
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

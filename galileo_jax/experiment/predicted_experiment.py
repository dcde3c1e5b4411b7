"""What each hypothesis would have the camera see of an experiment.

Draws of a hypothesis' posterior (of what the new clip has for itself: of its priors) are rolled
out. In units of the noise of this kind of track, a hypothesis' prediction is then described by a
normal distribution that is linear in the draws' coordinates u ~ N(0, 1),

    y = mean + slopes u + rest,    rest independent, as large as what the line leaves,

found by regression (statistical linearisation: S. Särkkä, Bayesian Filtering and Smoothing, 2013,
chapter 5), not by derivatives: frames that a hit may or may not have reached by then have a large
rest, and tell nothing.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from galileo_jax.experiment.hypothesis_probabilities import Belief
from galileo_jax.experiment.proposal import Proposal
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.numerics.least_squares import least_squares
from galileo_jax.numerics.normal_matrix import symmetric_root

NUM_DRAWS = 63  # and the mode: 64 rollouts for each hypothesis
MOVED_M = 0.002  # an object that goes so far was hit
FARTHEST_Z = 2.5  # of a draw
ONE_SD = 0.683  # of normal values so many are within one standard deviation


@dataclass(frozen=True)
class PredictedExperiment:
    """What one hypothesis predicts, in units of the noise."""

    mean: np.ndarray  # `[value]`
    slopes: np.ndarray  # `[value, coordinate]`
    # `[value]`, variance that the slopes leave; of the inner two thirds of the draws, so that a few
    # far ones do not drown what all others tell
    rest: np.ndarray
    hits: float  # share of the draws in which another object is hit
    # `[shared parameter, coordinate]`, how the trials' parameters (z) follow from u
    root: np.ndarray


def predict_experiment(
    proposal: Proposal, trials: JointProblem, beliefs: Sequence[Belief], seed: int
) -> list[PredictedExperiment]:
    """Rolls out every hypothesis at a setting.

    Draws are the same for all settings, so that they differ by nothing else.
    """
    drawn = [_draws(proposal, trials, belief, seed) for belief in beliefs]
    problem = proposal.problem
    theta = np.concatenate([rows for _, rows, _ in drawn])
    seen = problem.simulate_batch(theta)
    # Seen is what the first hypothesis has for most likely.
    observed = replace(problem.observation, position_m=seen[0])
    noisy = replace(problem, observation=observed)
    white = -noisy.whiten(seen, 1.0).reshape(len(beliefs), NUM_DRAWS + 1, -1)
    gone = np.ptp(seen[:, 1:, 0], axis=-1).max(axis=1, initial=0.0)
    hits = (gone > MOVED_M).reshape(len(beliefs), -1)
    return [
        _summary(u, rows[1:], float(hit[1:].mean()), root)
        for (u, _, root), rows, hit in zip(drawn, white, hits, strict=True)
    ]


def _draws(
    proposal: Proposal, trials: JointProblem, belief: Belief, seed: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates `[draw, u]`, parameters of the new scene `[1 + draw, parameter]`, and the root.

    The first row is the mode, with what the clip has for itself at its priors' middle.
    """
    problem = proposal.problem
    own_free = JointProblem((problem,)).free(belief.effects)
    where = {name: i for i, name in enumerate(trials.names)}
    source = [
        -1
        if p.role == "nuisance" or p.per_clip
        else where.get(proposal.renamed.get(p.name, p.name), -1)
        for p in problem.parameters
    ]
    shared = np.array(sorted({i for i in source if i >= 0 and belief.free[i]}), int)
    root = symmetric_root(belief.covariance[np.ix_(shared, shared)])
    own = [i for i, s in enumerate(source) if s < 0 and own_free[i]]
    count = len(shared) + len(own)
    from scipy.stats import qmc  # half a second

    sobol = qmc.MultivariateNormalQMC(np.zeros(count), rng=np.random.default_rng([seed, 67]))
    u = sobol.random(NUM_DRAWS + 1)[1:]
    u = np.vstack([np.zeros(count), np.clip(u, -FARTHEST_Z, FARTHEST_Z)])
    z = np.tile(belief.z, (len(u), 1))
    z[:, shared] += u[:, : len(shared)] @ root
    theirs = trials.theta(z, belief.free)
    theta = np.tile([p.absent for p in problem.parameters], (len(u), 1))
    for i, (parameter, s) in enumerate(zip(problem.parameters, source, strict=True)):
        if parameter.name in proposal.fixed:
            theta[:, i] = proposal.fixed[parameter.name]
        elif s >= 0:
            theta[:, i] = theirs[:, s]
    for column, i in enumerate(own, len(shared)):
        theta[:, i] = np.asarray(problem.parameters[i].prior.forward(jnp.asarray(u[:, column])))
    whole = np.zeros((len(trials.names), count))
    whole[shared, : len(shared)] = root
    return u[1:], theta, whole


def _summary(
    u: np.ndarray, white: np.ndarray, hits: float, root: np.ndarray
) -> PredictedExperiment:
    """The regression of values `[draw, value]` on coordinates `[draw, u]`."""
    design = np.column_stack([np.ones(len(u)), u])
    fit = least_squares(design, white)
    left = np.abs(fit.left) * np.sqrt(len(u) / max(len(u) - design.shape[1], 1))
    rest = np.quantile(left, ONE_SD, axis=0) ** 2
    return PredictedExperiment(fit.solution[0], fit.solution[1:].T, rest, hits, root)

"""Leave one clip out: how well the others of a series predict it.

A hypothesis that only follows the noise fits every clip and predicts none. Each clip in turn is
left out, the others are fitted together, and the clip is predicted with the parameters of the
objects that they gave; what is the clip's own (its release, its start) stays at its prior's
middle.
"""

import jax.numpy as jnp
import numpy as np

from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import velocity_error
from galileo_jax.model.parameters import Parameter
from galileo_jax.search.hypothesis import Hypothesis


def leave_one_out_rmse(trials: JointProblem, hypothesis: Hypothesis) -> tuple[float, ...]:
    """Per clip, the rmse (m/s) of its velocities as the other clips predict them."""
    return tuple(_one(trials, hypothesis, clip) for clip in range(len(trials.problems)))


def _one(trials: JointProblem, hypothesis: Hypothesis, clip: int) -> float:
    problem = trials.problems[clip]
    others = JointProblem(tuple(p for i, p in enumerate(trials.problems) if i != clip))
    kept = [i for i in range(len(trials.problems)) if i != clip]
    # Names count clips, so that they change where one is left out: places do not.
    start = np.zeros(len(others.model_parameters))
    for new, old in enumerate(kept):
        start[others.columns[new]] = hypothesis.fit.z[trials.columns[old]]
    free = others.free(hypothesis.effects)[: len(start)]
    fit = GradientFitter(others).fit_from(start[None], free[None], np.zeros(1, int))[0]
    shared = dict(zip(others.names, others.theta(fit.z, fit.free), strict=True))
    theta = np.array([_value(p, shared, hypothesis.effects) for p in problem.parameters])
    predicted = problem.simulate(theta)
    return velocity_error([problem], [predicted])["rmse"]


def _value(parameter: Parameter, shared: dict[str, float], effects: tuple[str, ...]) -> float:
    """What the others say; else the prior's middle of an effect that is there; else nothing."""
    is_own = parameter.role == "nuisance" or parameter.per_clip
    if not is_own and parameter.name in shared:
        return float(shared[parameter.name])
    if parameter.per_clip and parameter.name in effects:
        return float(parameter.prior.forward(jnp.asarray(0.0)))
    return parameter.absent

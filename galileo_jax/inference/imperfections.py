"""`imperfections` of result.json: how large what no model knows is, and whether that is usual."""

from typing import Any

import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior
from galileo_jax.inference.summarise import summary_of
from galileo_jax.model.effects.nuisances.trial_friction import TrialFriction
from galileo_jax.statespace.sizes import Sizes

BETWEEN_TRIALS, USUAL_SPREAD = "friction_between_trials", 0.15


def imperfections(
    trials: JointProblem, sizes: Sizes, posterior: Posterior
) -> dict[str, dict[str, Any]]:
    """By name `{mean, sd, q025, q975, unit, ordinary, meaning}`, of the draws of the sizes.

    `z`, of those that have it, is the logarithm of the most probable size over its prior's median,
    in the prior's standard deviations: what a run is loaded with.

    `trials`: the first clip's are the units of what depends on a clip. `sizes`: as fitted.
    `posterior`: of the parameters, how far trials differ among them.
    """
    problem, found = trials.problems[0], {}
    for name, x, drawn in zip(sizes.names, sizes.x, sizes.draws.T, strict=False):
        term = next(term for term in trials.terms if term.name == name)
        own = np.array([problem.size(term, float(each)) for each in drawn])
        low, high = np.quantile(own, [0.025, 0.975])
        found[name] = {
            "mean": float(own.mean()),
            "sd": float(own.std()),
            "q025": float(low),
            "q975": float(high),
            "unit": term.unit,
            "ordinary": name not in sizes.unusual,
            "meaning": term.meaning,
            "z": float(x),
        }
    if TrialFriction.spread in posterior.names:
        entry = summary_of(posterior, posterior[TrialFriction.spread].reshape(-1))
        found[BETWEEN_TRIALS] = {
            **entry,
            "unit": "1",
            "ordinary": entry["mean"] <= USUAL_SPREAD,
            "meaning": "friction differs from trial to trial by a share of {size}",
        }
    return found

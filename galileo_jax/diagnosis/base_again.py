"""The model without effects once more, from where an effect led its nuisances.

An effect may lead not because it is there but because its fit came to a valley that the fit without
it missed: boxes that part after a hit and meet again have one for every order of their touches,
and a nuisance reaches the same motion as an effect of the same kind. So where an effect leads by so
much that it could be named, the model without it starts again from that fit, all other parameters
making up for the effect as far as they can: with J_e the slope of the residuals with the effect's
strength s, and J that with the others,

    dz = (J^T J + 1)^-1 J^T J_e s.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.diagnosis.candidates import Hypothesis, reduced
from galileo_jax.diagnosis.diagnosis import Candidate
from galileo_jax.diagnosis.verdict import LAPLACE_NATS, NUM_JOINED
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.fits.normal_matrix import inverse
from galileo_jax.inference.joint_problem import JointProblem

STEP_Z = 1e-4


def better_base(
    fitter: GradientFitter, base: Hypothesis, candidates: Sequence[Candidate]
) -> Hypothesis | None:
    """A better fit without effects; None where those with effects lead to none.

    Args:
      fitter: of trials whose models have the whole library.
      base: the fit without effects.
      candidates: ranked.
    """
    leading = [c for c in candidates if c.log_evidence > LAPLACE_NATS][:NUM_JOINED]
    if not leading:
        return None
    starts = np.concatenate(
        [fitter.along_nuisances(without_effects(fitter.trials, c.hypothesis)) for c in leading]
    )
    free = np.tile(base.fit.free[: starts.shape[1]], (len(starts), 1))
    fits = fitter.polish(starts, free, np.zeros(len(starts), int)).values()
    fit = max(fits, key=lambda one: one.log_evidence)
    return Hypothesis((), fit) if fit.log_evidence > base.fit.log_evidence + LAPLACE_NATS else None


def without_effects(trials: JointProblem, hypothesis: Hypothesis) -> GradientFit:
    """A fit's other parameters where they make up for its effects: to start from, not a fit."""
    fit, count = hypothesis.fit, len(trials.model_parameters)
    start = reduced(trials, hypothesis, ()).fit
    others = start.free[:count]
    gone = np.flatnonzero(fit.free[:count] & ~others)
    slope = np.zeros(len(fit.jacobian))
    for i in gone:
        parameter, z = trials.model_parameters[i], float(fit.z[i])
        if parameter.absent == 0.0:  # a strength; places and lengths go with it
            value, ahead = (
                float(parameter.prior.forward(np.asarray(at)))  # pyright: ignore
                for at in (z, z + STEP_Z)
            )
            if ahead != value:
                slope += fit.jacobian[:, i] * (value * STEP_Z / (ahead - value))
    jacobian = fit.jacobian[:, :count][:, others]
    moved = start.z.copy()
    moved[:count][others] += inverse(jacobian.T @ jacobian + np.eye(jacobian.shape[1])) @ (
        jacobian.T @ slope
    )
    return replace(start, z=moved)

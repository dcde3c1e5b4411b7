"""The same fit in the parameters of more effects or of fewer.

A hypothesis of a diagnosis is the model with all effects, most of them fixed at zero.
"""

from dataclasses import replace

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem


def restricted_fit(fit: GradientFit, whole: JointProblem, part: JointProblem) -> GradientFit:
    """The same fit in the parameters of fewer effects; those left out are pinned in it.

    Args:
      fit: of `whole`.
      whole: trials with the whole library.
      part: of the same clips with the fit's own effects.

    Raises:
      ValueError: the fit has an effect that `part` has not.
    """
    columns = np.array([whole.names.index(name) for name in part.names])
    if np.delete(fit.free, columns).any():
        raise ValueError("the fit has parameters that the smaller model has not")
    model = columns[: len(part.model_parameters)]
    return replace(
        fit,
        z=fit.z[columns],
        free=fit.free[columns],
        covariance=fit.covariance[np.ix_(columns, columns)],
        steps=fit.steps[model],
        jacobian=fit.jacobian[:, model],
        beside=tuple(restricted_fit(one, whole, part) for one in fit.beside),
    )


def extended_fit(fit: GradientFit, part: JointProblem, whole: JointProblem) -> GradientFit:
    """The same fit in the parameters of more effects, which are pinned in it.

    Args:
      fit: of `part`.
      part: trials with the fit's own effects.
      whole: of the same clips with more.
    """
    columns = np.array([whole.names.index(name) for name in part.names])
    model, count = columns[: len(part.model_parameters)], len(whole.names)
    steps = np.zeros(len(whole.model_parameters))
    z, free = np.zeros(count), np.zeros(count, bool)
    covariance = np.zeros((count, count))
    jacobian = np.zeros((len(fit.jacobian), len(steps)))
    z[columns], free[columns], steps[model] = fit.z, fit.free, fit.steps
    covariance[np.ix_(columns, columns)] = fit.covariance
    jacobian[:, model] = fit.jacobian
    return replace(
        fit,
        z=z,
        free=free,
        covariance=covariance,
        steps=steps,
        jacobian=jacobian,
        beside=tuple(extended_fit(one, part, whole) for one in fit.beside),
    )

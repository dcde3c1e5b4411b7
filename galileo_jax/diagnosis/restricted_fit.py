"""Converts a hypothesis of a diagnosis to the fit of the model with only its effects.

A hypothesis is the model with all effects, most of them fixed at zero.
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

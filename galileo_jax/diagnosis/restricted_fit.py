"""The same fit in the parameters of more effects or of fewer.

A hypothesis of a diagnosis is the model with all effects, most of them fixed at zero.
"""

from dataclasses import replace

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem


def fit_among(fit: GradientFit, own: JointProblem, other: JointProblem) -> GradientFit:
    """The same fit in the parameters of other effects, of which those that it has not are pinned.

    Raises:
      ValueError: the fit has a parameter that `other` has not.
    """
    at = own.places(other.names)
    if np.delete(fit.free, at[at >= 0]).any():
        raise ValueError("the fit has parameters that the other model has not")

    def taken(values: np.ndarray, axis: int = 0) -> np.ndarray:
        """Values along an axis of parameters, 0 of those that the fit has not."""
        is_of_model = values.shape[axis] < len(own.names)
        where = at[: len(other.model_parameters)] if is_of_model else at
        shape = [-1 if i == axis else 1 for i in range(values.ndim)]
        return np.take(values, where, axis) * (where >= 0).reshape(shape)

    return replace(
        fit,
        z=taken(fit.z),
        free=taken(fit.free),
        covariance=taken(taken(fit.covariance), 1),
        steps=taken(fit.steps),
        jacobian=taken(fit.jacobian, 1),
        beside=tuple(fit_among(one, own, other) for one in fit.beside),
    )

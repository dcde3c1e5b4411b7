"""What an effect that the model lacks would change in the numbers that a fit gives.

The fit with the effect held at a strength is the least |r(z)|^2 + |z|^2, r the whitened residuals
and z the free parameters. From the fit without it, steps with that fit's own slopes J lead there:

    dz = -(J' J + 1)^-1 (J' r(z) + z)

Limits: an estimate, since the slopes are not taken again; a step that finds nothing better is not
taken.
"""

import re
from collections.abc import Mapping
from typing import TypedDict

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.mass_ratios import mass_ratios
from galileo_jax.search.score_tests import misfit

STEPS = 4
LEAST_SDS = 1.0
SHOWS_NATS = 50.0  # what is left so much worse shows, whatever the slopes without it say
RATE_Z = 1e-3  # a difference over it is a derivative
SAME_AS_RATIO = "phi"
MASS = re.compile(r"m\d+")


class Changed(TypedDict):
    """A change of a number, in its unit and in its standard deviations."""

    by: float
    sds: float


def changed_numbers(
    trials: JointProblem, fit: GradientFit, probes: np.ndarray
) -> list[dict[str, Changed]]:
    """The main parameters and ratios of masses that would be others, by more than their sd.

    Of each case: by how much, in the number's unit and in sds, two figures of both. `fit`: of a
    model without some of the effects of `trials`. `probes`: `[case, parameter]`, in units: its
    parameters with an effect at some strength.
    """
    count = fit.jacobian.shape[1]
    free = np.flatnonzero(fit.free[:count])
    here = np.asarray(trials.theta(fit.z, fit.free))
    is_held = probes != here  # the effect's own
    slopes = fit.jacobian[:, free]
    inverse = np.linalg.inv(slopes.T @ slopes + np.eye(len(free)))

    def left(z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residuals `[case, value]`, and what is to be least, `[case]`."""
        theta = np.where(is_held, probes, trials.theta(z, fit.free))
        white = np.concatenate(trials.whitened(theta, here[count:]), axis=1)
        return white, np.sum(white**2, axis=1) + np.sum(z[:, free] ** 2, axis=1)

    z = np.tile(fit.z, (len(probes), 1))
    white, cost = left(z)
    for _ in range(STEPS):
        ahead = z.copy()
        ahead[:, free] -= (white @ slopes + z[:, free]) @ inverse
        white_ahead, cost_ahead = left(ahead)
        is_better = (cost_ahead < cost)[:, None]
        z, white = np.where(is_better, ahead, z), np.where(is_better, white_ahead, white)
        cost = np.minimum(cost, cost_ahead)
    is_hidden = cost < misfit(trials, fit) + 2 * SHOWS_NATS
    before, after = _numbers(trials, fit, fit.z[None]), _numbers(trials, fit, z)
    nearby = np.tile(fit.z, (len(free), 1))
    nearby[np.arange(len(free)), free] += RATE_Z
    beside = _numbers(trials, fit, nearby)
    found: list[dict[str, Changed]] = [{} for _ in probes]
    for name, (value,) in before.items():
        rate = (beside[name] - value) / RATE_Z
        sds = (after[name] - value) / np.sqrt(rate @ inverse @ rate)
        for i in np.flatnonzero(is_hidden & (np.abs(sds) > LEAST_SDS)):
            by = float(f"{after[name][i] - value:.2g}")
            found[i][name] = {"by": by, "sds": float(f"{sds[i]:.2g}")}
    return found


def _numbers(trials: JointProblem, fit: GradientFit, z: np.ndarray) -> Mapping[str, np.ndarray]:
    """The main parameters that are free, and the ratios of masses: `[case]` each."""
    theta = np.asarray(trials.theta(z, fit.free))
    found = {
        one.name: theta[:, i]
        for i, one in enumerate(trials.model_parameters)
        if one.role == "main" and fit.free[i]
    }
    ratios = mass_ratios([values for name, values in found.items() if MASS.fullmatch(name)])
    return found | {name: values for name, values in ratios.items() if name != SAME_AS_RATIO}

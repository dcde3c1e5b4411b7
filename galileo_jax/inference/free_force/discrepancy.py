"""A fit with what no model explains allowed for: a Gaussian-process acceleration of every object.

1. Hypothesis and a free acceleration are fitted together, the latter with a wide prior.
2. Round the fit, residuals are linear in all unknowns. Sizes and lengths of the process get their
   probabilities from the marginal likelihood (`kernels`).
3. Both are fitted again, with accelerations of the size that was found, and 2. is done again.
4. The posterior: draws from the posteriors of all sizes, as often as these are probable
   (`ridge`). An interval of k1 is then marginal over the acceleration and over what is known of
   its size.

An object at rest, and a hit, answer an acceleration as the model says: covariances of positions
that follow from it come out of rollouts, not of a second integral.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from galileo_jax.inference.fits.gradient import SETTLED
from galileo_jax.inference.free_force.free_fit import FreeFit, free_fit, resized
from galileo_jax.inference.free_force.kernels import Size, probable_sizes
from galileo_jax.inference.free_force.ridge import Linear, drawn
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status

SMALLEST_M_S2 = 0.001  # less shows in no track


@dataclass(frozen=True)
class Discrepancy:
    """A fit with a Gaussian-process acceleration.

    Attributes:
      free: the fit, its mode and covariance those of the mixture.
      posterior: draws of all parameters, the accelerations' knots among them.
      summary: what result.json holds under `discrepancy`.
    """

    free: FreeFit
    posterior: Posterior
    summary: dict[str, Any]


def fit_discrepancy(
    trials: JointProblem, z: np.ndarray, free: np.ndarray, seed: int
) -> Discrepancy:
    """Fits trials with a Gaussian-process acceleration beside a hypothesis.

    Args:
      trials: one clip or several of the same objects.
      z: `[parameter]`, of the hypothesis' fit, noise scales last.
      free: `[parameter]`, which parameters it has.
      seed: of the draws.
    """
    found = free_fit(trials, z, free, num_spans=1)
    at = Linear.of(found)
    sizes, share = probable_sizes(at.white_target, at.knots)
    found = resized(found, _usual(sizes, share).tolist())
    at = Linear.of(found)
    sizes, share = probable_sizes(at.white_target, at.knots)
    draws_z = drawn(found, at, sizes, share, np.random.default_rng([seed, 67]))
    gradient = replace(found.gradient, covariance=np.cov(draws_z, rowvar=False))
    extended = found.trials
    posterior = Posterior(
        names=extended.names,
        draws=extended.theta(draws_z, found.free)[None],
        log_density=np.zeros((1, len(draws_z))),
        status=Status.CONVERGED if gradient.code in SETTLED else Status.STEP_LIMIT,
        stats=gradient.stats,
        provenance={"method": "grad", "seed": seed, "code": gradient.code.name},
    )
    found = replace(found, gradient=gradient)
    return Discrepancy(found, posterior, _summary(found, sizes, share))


def _usual(sizes: list[Size], share: np.ndarray) -> np.ndarray:
    """The geometric mean size of each object's acceleration, m/s^2."""
    table = np.array([size.sizes_m_s2 for size in sizes])
    return np.exp(share @ np.log(np.maximum(table, SMALLEST_M_S2)))


def _summary(found: FreeFit, sizes: list[Size], share: np.ndarray) -> dict[str, Any]:
    names = found.trials.problems[0].observation.names
    of_time = float(np.sum(share[[size.of == "time" for size in sizes]]))
    usual = _usual(sizes, share)
    return {
        "kind": "gp",
        "probability_of_time": of_time,
        "length_share": float(np.exp(share @ np.log([size.length for size in sizes]))),
        "size_m_s2": dict(zip(names, usual.tolist(), strict=True)),
        "spans_s": {
            problem.name: [[list(span) for span in own] for own in effect.spans_s]
            for problem, effect in zip(found.trials.problems, found.effects, strict=True)
        },
    }

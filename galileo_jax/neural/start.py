"""Metropolis-Hastings from the network, in place of a search: `fit --method mh --init cnn`.

    1. Levenberg-Marquardt from the middle of the network's posterior: no scattered starts.
    2. Every chain starts at a draw of the network's posterior of masses and frictions, and of the
       nuisances given these, by the normal approximation at the fit: of a few draws the one that
       fits best, because a small coefficient of restitution is anything but normal.

As Galileo's recognition network starts its chains. The network's intervals are wider than the
posterior, so that chains start apart, as R-hat needs it.

Source: J. Wu et al., Galileo: perceiving physical object properties by integrating a physics
engine with deep learning, NIPS 2015, section 5.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.parameters import inverse
from galileo_jax.neural.estimate import cnn_posterior
from galileo_jax.search.fit import refit

NUM_COMPLETIONS = 4


@dataclass(frozen=True)
class Start:
    """Where chains begin."""

    # The mode next to the network's middle, and its covariance: the first proposals
    fit: GradientFit
    z: np.ndarray  # `[chain, parameter]`, a start for every chain
    notes: dict[str, Any]  # for result.json; `warnings` where the clip is unlike the training clips


def start_from_network(trials: JointProblem, seed: int, num_chains: int) -> Start:
    """Asks the network, fits from its answer, and draws the starts.

    Raises:
      InputError: a clip that the network does not know, see `cnn_posterior`.
    """
    posterior, middle, notes = cnn_posterior(trials, seed)
    free = trials.free(())[: len(trials.model_parameters)]
    fitter = GradientFitter(trials)
    (fit,) = fitter.fit_from(middle[None, : len(free)], free[None], np.zeros(1, int))
    # A small coefficient of restitution has a valley on either side; the network knows of neither.
    fit = refit(fitter, fit)
    generator = np.random.default_rng([seed, 8])
    drawn = posterior.flat()[generator.choice(posterior.draws.shape[1], num_chains)]
    known = np.array([parameter.role == "main" for parameter in trials.parameters])
    z = inverse(trials.parameters, np.asarray(drawn))
    tried = completed(np.repeat(z, NUM_COMPLETIONS, axis=0), known, fit, generator)
    costs = fitter.search_costs(tried[:, : len(free)], np.tile(free, (len(tried), 1)))
    best = np.argmin(costs.reshape(num_chains, -1), axis=1)
    z = tried.reshape(num_chains, NUM_COMPLETIONS, -1)[np.arange(num_chains), best]
    told: dict[str, Any] = {"init": "cnn"}
    if "warnings" in notes:
        told["warnings"] = [
            "--init cnn: this clip is unlike those that the network was trained on; compare with "
            "--init grad"
        ]
    return Start(fit, z, told)


def completed(
    z: np.ndarray, known: np.ndarray, fit: GradientFit, generator: np.random.Generator
) -> np.ndarray:
    """Draws of what is not `known`, given what is: N(mode, covariance) of the fit, conditional.

    `z`: `[chain, parameter]`, right where `known`.
    """
    covariance, rest = fit.covariance, ~known
    slope = np.linalg.solve(covariance[np.ix_(known, known)], covariance[np.ix_(known, rest)])
    left = covariance[np.ix_(rest, rest)] - covariance[np.ix_(rest, known)] @ slope
    noise = generator.standard_normal((len(z), int(rest.sum()))) @ np.linalg.cholesky(left).T
    whole = z.copy()
    whole[:, rest] = fit.z[rest] + (z - fit.z)[:, known] @ slope + noise
    return whole

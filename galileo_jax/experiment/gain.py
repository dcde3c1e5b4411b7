"""By how much an experiment is expected to tell: the mutual information, in nats.

Between the hypothesis H and the data y,

    I(H; y) = sum_h P(h) E[ log p(y | h) - log sum_h' P(h') p(y | h') ],   y drawn from h,

a nested Monte Carlo estimate (T. Rainforth et al., On nesting Monte Carlo estimators, 2018,
arXiv:1709.06181) whose inner integral over a hypothesis' parameters is not sampled but done in
closed form with its linearised prediction (as Q. Long et al., Fast estimation of expected
information gains, 2013, doi:10.1016/j.cma.2013.02.017): p(y | h) = N(mean, 1 + rest + slopes
slopes'). The outer draws are of the same distributions. What a line does not describe is therefore
noise on both sides: it hides differences and never feigns one. Settings are ranked so in D.
Cavagnaro et al., Adaptive design optimization, 2010, doi:10.1162/neco.2009.02-09-959.

About a parameter, given the hypothesis, the gain is half the logarithm of its variance before over
that after.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_softmax

from galileo_jax.experiment.predicted_experiment import PredictedExperiment

NUM_TRACKS = 256  # drawn from each hypothesis


class Gain(NamedTuple):
    """What an experiment is expected to tell."""

    nats: float  # about which hypothesis holds
    named: float  # how probable it is that the true one is then ahead of all others by the margin
    lead: float  # how far it is then ahead on average, nats of log odds


def about_hypotheses(
    predicted: Sequence[PredictedExperiment], log_odds: np.ndarray, margin: float, seed: int
) -> Gain:
    """The gain about which hypothesis holds.

    `log_odds` `[hypothesis]` are those before it; all others must be behind by `margin` nats.
    """
    log_prior = log_softmax(log_odds)
    generator = np.random.default_rng([seed, 71])
    found = []
    for truth, one in enumerate(predicted):
        u = generator.standard_normal((NUM_TRACKS, one.slopes.shape[1]))
        noise = generator.standard_normal((NUM_TRACKS, len(one.mean)))
        y = one.mean + u @ one.slopes.T + np.sqrt(1.0 + one.rest) * noise
        after = log_prior[:, None] + np.stack([log_density(other, y) for other in predicted])
        gained = log_softmax(after, axis=0)[truth] - log_prior[truth]
        rivals = np.delete(after, truth, axis=0).max(axis=0, initial=-np.inf)
        ahead = after[truth] - rivals
        found.append((gained.mean(), np.mean(ahead >= margin), ahead.mean()))
    nats, named, lead = np.exp(log_prior) @ np.array(found)
    return Gain(max(float(nats), 0.0), float(named), float(lead))


def about_parameter(one: PredictedExperiment, weights: np.ndarray) -> float:
    """The gain about a parameter if a hypothesis holds, nats.

    `weights` `[parameter]` combine the trials' parameters, in z.
    """
    along = weights @ one.root
    before = float(along @ along)
    if before <= 0.0:
        return 0.0
    scaled = one.slopes / np.sqrt(1.0 + one.rest)[:, None]
    information = np.eye(len(along)) + scaled.T @ scaled
    return 0.5 * float(np.log(before / (along @ np.linalg.solve(information, along))))


def log_density(one: PredictedExperiment, white: np.ndarray) -> np.ndarray:
    """Log N(white; mean, 1 + rest + slopes slopes'), `[draw, value]` to `[draw]`.

    Up to the constant that all hypotheses share.
    """
    variance = 1.0 + one.rest
    scaled = one.slopes / np.sqrt(variance)[:, None]
    left = (white - one.mean) / np.sqrt(variance)
    information = np.eye(scaled.shape[1]) + scaled.T @ scaled
    root = np.linalg.cholesky(information)
    taken = np.linalg.solve(root, scaled.T @ left.T)
    square = np.sum(left**2, axis=1) - np.sum(taken**2, axis=0)
    log_determinant = np.sum(np.log(variance)) + 2 * np.sum(np.log(np.diag(root)))
    return -0.5 * (square + log_determinant)

"""Would errors of the track that change slowly do what a formula does?

A hand that shakes a camera, a lens, marks that lag behind: their errors change within a second or
so, and no track tells them from a small force (`measurement/errors_in_time` sees the faster ones).
A formula is searched for among hundreds and bends to such errors. So it must be better than they
are: beside every hypothesis with a name, and beside none, smooth errors of unknown size and length
are allowed for (a Gaussian process of each coordinate), and the evidence this adds is, in the
linear model round the fit,

    log E' - log E = b.(1 + M)^-1 b / 2 - log det(1 + M) / 2,    M = W^T P W,  b = W^T P r

r: whitened residuals; W: the errors' patterns, whitened; P: what the parameters do not take up. It
is averaged over size and length. Sizes are those of the stated errors: what a formula does to the
track beyond that, slow errors cannot.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from galileo_jax.comparison.bootstrap import whitened
from galileo_jax.diagnosis import reasons
from galileo_jax.diagnosis.candidates import Hypothesis
from galileo_jax.diagnosis.diagnosis import Candidate, Verdict
from galileo_jax.inference.fits.gradient import GradientFit
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.random_patterns import random_patterns

SIZES = (0.35, 0.7, 1.4)  # times what is stated of a point
LENGTHS = (0.05, 0.1, 0.2)  # of the time that an object is seen: at least `LEAST_ROWS` rows
LEAST_ROWS = 2.0
ERRORS_ODDS = 0.25  # of there being such errors, against none
NUM_TRIED = 12  # hypotheses, the most probable with a name


@dataclass(frozen=True)
class SlowErrors:
    """What slow errors add to a hypothesis.

    Attributes:
      adds: log evidence and the log prior of there being such errors, nats.
      size: the most probable standard deviation over that of a point as stated.
      lasts_s: how soon they change, s.
    """

    adds: float
    size: float
    lasts_s: float


def unless_slow_errors(
    trials: JointProblem,
    base: Hypothesis,
    verdict: Verdict,
    candidates: Sequence[Candidate],
    decisive: float,
) -> Verdict:
    """The verdict; unknown in place of law where slow errors explain the data about as well.

    Where nothing explains the data, it is said if slow errors would. All else stays, as it does
    where no camera is known to have filmed.

    Args:
      trials: what was diagnosed.
      base: the model without effects.
      verdict: after formulas were tried.
      candidates: ranked.
      decisive: nats by which one hypothesis must be ahead of another.
    """
    is_filmed = all(problem.noise == "camera" for problem in trials.problems)
    if verdict.status not in ("law", "unknown") or not is_filmed:
        return verdict
    names = [c for c in candidates if not c.is_form and c.law is None][:NUM_TRIED]
    tried = [("no effect", 0.0, base), *((c.title, c.log_odds, c.hypothesis) for c in names)]
    found = [(title, log_odds, _beside(one.of(trials), one.fit)) for title, log_odds, one in tried]
    title, before, slow = max(found, key=lambda each: each[1] + each[2].adds)
    rival = next((c for c in candidates if c.effects == verdict.effects), candidates[0])
    ahead = before + slow.adds - rival.log_odds
    if ahead < (decisive if verdict.status == "unknown" else -decisive):
        return verdict
    said = reasons.slow_errors(title, slow.lasts_s, slow.size, rival, ahead)
    because = (*verdict.reasons, said)
    if verdict.status == "unknown":
        return replace(verdict, reasons=because)
    return Verdict("unknown", (), reasons=because)


def _beside(trials: JointProblem, fit: GradientFit) -> SlowErrors:
    theta = trials.theta(fit.z, fit.free)
    scales = theta[len(trials.model_parameters) :]
    residual = np.concatenate(whitened(trials, theta[None], scales), axis=1)[0]
    free = fit.free[: fit.jacobian.shape[1]]
    jacobian, z = fit.jacobian[:, free], fit.z[: len(free)][free]
    log_odds, sizes, lasts = [], [], []
    for length in LENGTHS:
        patterns, lasts_s = _whitened_patterns(trials, scales, length)
        log_odds.extend(evidence_added(residual, jacobian, z, patterns))
        sizes.extend(SIZES)
        lasts.extend([lasts_s] * len(SIZES))
    best = int(np.argmax(log_odds))
    adds = float(np.logaddexp.reduce(log_odds)) + math.log(ERRORS_ODDS / len(log_odds))
    return SlowErrors(adds, sizes[best], lasts[best])


def evidence_added(
    residual: Float[np.ndarray, " value"],
    jacobian: Float[np.ndarray, "value parameter"],
    z: Float[np.ndarray, " parameter"],
    patterns: Float[np.ndarray, "value pattern"],
) -> list[float]:
    """Log evidence that errors of these patterns add, for each of `SIZES`, nats.

    Args:
      residual: whitened, at the fit.
      jacobian: its slopes there.
      z: the fit, in units of the priors.
      patterns: whitened, of unit size.
    """
    count = len(z)
    basis, _ = np.linalg.qr(np.vstack([jacobian, np.eye(count)]))
    whole = np.append(residual, z)
    left = whole - basis @ (basis.T @ whole)
    patterns = np.pad(patterns, [(0, count), (0, 0)])
    patterns -= basis @ (basis.T @ patterns)
    values, vectors = np.linalg.eigh(patterns.T @ patterns)
    along2 = (vectors.T @ (patterns.T @ left)) ** 2
    gains = [(size**2, 1.0 + size**2 * np.maximum(values, 0.0)) for size in SIZES]
    return [0.5 * float(np.sum(s2 * along2 / gain - np.log(gain))) for s2, gain in gains]


def _whitened_patterns(
    trials: JointProblem, scales: np.ndarray, length: float
) -> tuple[np.ndarray, float]:
    """`[value, pattern]` of all clips, and how long they last, s (of the first clip)."""
    found, lasts = [], []
    values = [problem.data.observed_m.size for problem in trials.problems]
    before = np.concatenate([[0], np.cumsum(values)])
    for clip, problem in enumerate(trials.problems):
        patterns, lasts_s = _patterns(problem.observation, length)
        lasts.append(lasts_s)
        # Whitened as differences of the data are: from a prediction that is the data.
        white = problem.whiten(problem.data.observed_m - patterns, float(scales[clip]))
        whole = np.zeros((before[-1], len(patterns)))
        whole[before[clip] : before[clip + 1]] = white.T
        found.append(whole)
    return np.concatenate(found, axis=1), lasts[0]


def _patterns(observation: Observation, length: float) -> tuple[np.ndarray, float]:
    """`[pattern, object, axis, frame]`, m, of unit size in what is stated; and the length, s."""
    times, found = observation.times_s, []
    lasts_s = max(length * float(np.ptp(times)), LEAST_ROWS * float(np.median(np.diff(times))))
    apart = (times[:, None] - times) / lasts_s
    patterns = random_patterns(np.exp(-0.5 * apart**2))
    for i, mask in enumerate(observation.mask):
        for a in range(observation.position_m.shape[1]):
            own = np.zeros((len(patterns), *observation.position_m.shape))
            own[:, i, a, mask] = patterns[:, mask] * np.sqrt(
                observation.covariance_m2[i, a, a, mask]
            )
            found.append(own)
    return np.concatenate(found), lasts_s

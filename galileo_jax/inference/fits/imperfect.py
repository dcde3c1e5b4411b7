"""How large the imperfections of a clip are: sizes of `statespace` terms, by what a fit leaves.

Linear round the fit, with the parameters integrated out under their priors (z ~ N(0, 1)),

    e = w - J z_fit  ~  N(0, s^2 1 + U U^T + J J^T + sum_k size_k^2 K_k)

in units of the stated tracking errors; the log sizes have normal priors, x_k = log(size_k / median_k)
/ log(factor_k) ~ N(0, 1). Their most probable values come by Newton steps with the average
information, their evidence by Laplace,

    log p(e) = log p(e | x) - x.x / 2 - log det(H) / 2.

Each clip of several is taken with parameters of its own, so that what differs from trial to trial
is not taken for roughness within one.

Source: Gilmour, Thompson and Cullis (1995), Average information REML, Biometrics 51, 1440; MacKay
(1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.linalg
from jaxtyping import Float

from galileo_jax.inference.fits.evidence import GradientFit
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.problem import Problem

MOST_STEPS, STILL = 60, 1e-6
LONGEST_STEP = 1.5  # of a log size, in units of its prior's width
LARGEST = 6.0


@dataclass(frozen=True)
class Sizes:
    """The most probable sizes.

    Attributes:
      x: `[term]`, log sizes in units of their priors.
      information: `[term, term]`, of the log posterior, prior included.
    """

    x: Float[np.ndarray, " term"]
    information: Float[np.ndarray, "term term"]

    @property
    def log_evidence(self) -> float:
        """Of there being sizes, beside the likelihood at the most probable ones, nats."""
        return float(-0.5 * self.x @ self.x - 0.5 * np.linalg.slogdet(self.information)[1])


@dataclass(frozen=True)
class _Clip:
    """What of one clip tells sizes.

    Attributes:
      e: `[value]`.
      fixed: `[value, value]`, the covariance whatever the sizes are, without the noise's.
      of_terms: by the term's name, at unit size `[value, value]`.
    """

    e: np.ndarray
    fixed: np.ndarray
    of_terms: dict[str, np.ndarray]


def fitted_sizes(trials: JointProblem, fit: GradientFit) -> Sizes:
    """The sizes that a fit asks for, of the terms `trials.terms`, in their order.

    Args:
      trials: with the sizes that were fitted with.
      fit: its residuals and slopes are taken as they are.
    """
    terms, x = trials.terms, trials.sizes.copy()
    if not terms:
        return Sizes(x, np.eye(0))
    clips = _clips(trials, fit)
    noise = fit.z[len(trials.model_parameters) :].copy()
    both = np.concatenate([x, noise])
    value, gradient, information = _look(clips, terms, both)
    damping = 1e-3
    for _ in range(MOST_STEPS):
        step = np.linalg.solve(information + damping * np.eye(len(both)), gradient)
        step *= min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-12))
        there = np.clip(both + step, -LARGEST, LARGEST)
        new = _look(clips, terms, there)
        if new[0] >= value - 1e-9:
            moved = np.abs(there - both).max()
            both, (value, gradient, information) = there, new
            damping = max(damping / 5, 1e-6)
            if moved < STILL:
                break
        else:
            damping *= 10
            if damping > 1e8:
                break
    count = len(terms)
    return Sizes(both[:count], information[:count, :count])


def _clips(trials: JointProblem, fit: GradientFit) -> list[_Clip]:
    theta, count = trials.theta(fit.z, fit.free), len(trials.model_parameters)
    found, first = [], 0
    for index, problem in enumerate(trials.problems):
        size = problem.observation.position_m.size
        scale = trials.noise_scale(theta, index)
        rows = fit.jacobian[first : first + size]
        first += size
        predicted = problem.simulate(trials.of_clip(theta, index))
        white = problem.whiten(predicted, scale)
        data = problem.data
        is_seen = np.repeat(
            problem.observation.mask[:, None], problem.observation.position_m.shape[1], axis=1
        ).reshape(-1)
        every = np.column_stack([white - rows @ fit.z[:count], rows])
        every = _in_stated_errors(every, scale, problem)[is_seen]
        slopes = every[:, 1:][:, fit.free[:count]]
        modes = problem.fixed_patterns.reshape(len(problem.fixed_patterns), -1)[:, is_seen]
        fixed = modes.T @ modes + slopes @ slopes.T
        of_terms = {}
        for term, patterns in problem.patterns.items():
            own = patterns.reshape(len(patterns), -1)[:, is_seen]
            of_terms[term] = own.T @ own
        assert data.num_values <= is_seen.sum()
        found.append(_Clip(every[:, 0], fixed, of_terms))
    return found


def _in_stated_errors(white: np.ndarray, scale: float, problem: Problem) -> np.ndarray:
    """Columns of whitened residuals in units of the stated tracking errors."""
    data = problem.data
    basis = data.basis.reshape(len(data.gain), -1)
    along = basis @ white
    more = np.sqrt(scale**2 + data.gain**2) - scale
    return scale * white + basis.T @ (more[:, None] * along)


def _look(
    clips: Sequence[_Clip], terms: Sequence, x: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """The log posterior of log sizes and noise scales, its gradient, its average information."""
    value, gradient, information = -0.5 * float(x @ x), -x.copy(), np.eye(len(x))
    count = len(terms)
    for index, clip in enumerate(clips):
        which, parts = [count + index], [np.exp(2 * NOISE_SD * x[count + index]) * np.eye(len(clip.e))]
        cover = clip.fixed + parts[0]
        for k, term in enumerate(terms):
            if term.name in clip.of_terms:
                part = np.exp(2 * np.log(term.factor) * x[k]) * clip.of_terms[term.name]
                which.append(k)
                parts.append(part)
                cover = cover + part
        root = scipy.linalg.cholesky(cover, lower=True)
        inverse = scipy.linalg.lapack.dpotri(root, lower=True)[0]
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        pulled = inverse @ clip.e
        value -= 0.5 * float(clip.e @ pulled) + float(np.log(np.diag(root)).sum())
        scales = np.array([NOISE_SD if k >= count else np.log(terms[k].factor) for k in which])
        moved = np.stack([part @ pulled for part in parts], axis=1) * scales
        gradient[which] += pulled @ moved - scales * np.array(
            [np.sum(inverse * part) for part in parts]
        )
        # Of log variances' halves: d cover / d x_k = 2 scale_k part_k.
        information[np.ix_(which, which)] += 2 * moved.T @ inverse @ moved
    return value, gradient, information

"""How large the imperfections of a clip are: sizes of `statespace` terms, by what a fit leaves.

Linear round the fit, with the parameters integrated out under their priors (z ~ N(0, 1)),

    e = w - J z_fit  ~  N(0, s^2 1 + U U^T + J J^T + sum_k size_k^2 K_k)

in units of the stated tracking errors; sizes are log-normal before the data: x_k = log(size_k
/ median_k) / log(factor_k) ~ N(0, 1). The most probable ones come by Newton steps with the average
information, their evidence by Laplace,

    log p(e) = log p(e | x) - x.x / 2 - log det(H) / 2.

Each clip of several is taken with parameters of its own, so that what differs from trial to trial
is not taken for roughness within one.

Source: Gilmour, Thompson and Cullis (1995), Average information REML, Biometrics 51, 1440; MacKay
(1992), Bayesian interpolation, Neural Computation 4, 415.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import scipy.linalg

from galileo_jax.inference.fits.gradient import Code, GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.statespace.sizes import Sizes
from galileo_jax.statespace.term import Term

MOST_ROUNDS, SETTLED = 4, 0.02  # of sizes and fits by turns; of a log size
MOST_STEPS, STILL = 60, 1e-6
STILL_NATS = 1e-9
LEAST_DAMPING = 1e-6
LONGEST_STEP = 1.5  # of a log size, in units of its prior's width
LARGEST = 6.0


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


def fit_with_imperfections(
    trials: JointProblem,
    seed: int,
    on_stage: Callable[[str], None] = lambda _: None,
    effects: Sequence[str] | None = None,
) -> tuple[JointProblem, GradientFit]:
    """Trials with the sizes of imperfections that they ask for, and their fit.

    It is searched for as if there were none: then valleys are narrow and far apart. A second search
    is spared where imperfections of ordinary sizes explain what the first one leaves.

    Args:
      trials: without sizes.
      seed: of the starts; the same seed gives the same result.
      on_stage: told what is being done.
      effects: names of the effects that are there; default: all of the models'.
    """
    fitter = GradientFitter(trials)

    def is_enough(fit: GradientFit) -> bool:
        return fitter.is_explained(fit) or is_ordinary(*with_imperfections(trials, fit))

    fit = fitter.fit(seed, on_stage, effects, is_enough)
    on_stage("sizing imperfections")
    return with_imperfections(trials, fit)


def is_ordinary(trials: JointProblem, fit: GradientFit) -> bool:
    """Whether a fit converged and all imperfections are of sizes that are usual."""
    if fit.sizes is None or fit.code is not Code.CONVERGED:
        return False
    return not any(problem.unusual(fit.sizes.by_name) for problem in trials.problems)


def with_imperfections(trials: JointProblem, fit: GradientFit) -> tuple[JointProblem, GradientFit]:
    """The trials with the sizes of imperfections that a fit asks for, and the fit with these.

    Sizes and parameters are fitted by turns until both stand still.

    Args:
      trials: that were fitted, with sizes or without.
      fit: of them, with the valleys beside it.
    """
    if not trials.terms or fit.code is Code.FAILED:
        return trials, fit
    x = np.zeros(len(trials.terms)) if fit.sizes is None else fit.sizes.x
    for _ in range(MOST_ROUNDS):
        sizes = fitted_sizes(trials, fit, x)
        moved, x = np.abs(sizes.x - x).max(), sizes.x
        trials = trials.with_sizes(sizes.by_name)
        fit = replace(GradientFitter(trials).continued(fit), sizes=sizes)
        if moved < SETTLED:
            break
    more = sizes.log_evidence
    beside = tuple(replace(one, log_evidence=one.log_evidence + more) for one in fit.beside)
    return trials, replace(fit, log_evidence=fit.log_evidence + more, beside=beside)


def fitted_sizes(trials: JointProblem, fit: GradientFit, x: np.ndarray) -> Sizes:
    """The sizes that a fit asks for, of the terms `trials.terms`, in their order.

    Args:
      trials: with the sizes that were fitted with.
      fit: its residuals and slopes are taken as they are.
      x: `[term]`, where to begin.
    """
    terms, count = trials.terms, len(trials.terms)
    clips = _clips(trials, fit)
    both = np.concatenate([x, fit.z[len(trials.model_parameters) :]])
    here = _look(clips, terms, both)
    damping = LEAST_DAMPING
    for _ in range(MOST_STEPS):
        step = np.linalg.solve(here.information + damping * np.eye(len(both)), here.gradient)
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), STILL))
        there = np.clip(both + step, -LARGEST, LARGEST)
        new = _look(clips, terms, there)
        if new.value < here.value - STILL_NATS:
            damping *= 10
            continue
        moved, both, here = np.abs(there - both).max(), there, new
        damping = max(damping / 5, LEAST_DAMPING)
        if moved < STILL:
            break
    names = tuple(term.name for term in terms)
    return Sizes(names, both[:count], here.information[:count, :count])


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
        found.append(_Clip(every[:, 0], fixed, of_terms))
    return found


def _in_stated_errors(white: np.ndarray, scale: float, problem: Problem) -> np.ndarray:
    """Columns of whitened residuals in units of the stated tracking errors."""
    data = problem.data
    basis = data.basis.reshape(len(data.gain), -1)
    along = basis @ white
    more = np.sqrt(scale**2 + data.gain**2) - scale
    return scale * white + basis.T @ (more[:, None] * along)


class _Look(NamedTuple):
    """The log posterior of log sizes and noise scales, its gradient, its average information."""

    value: float
    gradient: np.ndarray
    information: np.ndarray


def _look(clips: Sequence[_Clip], terms: Sequence[Term], x: np.ndarray) -> _Look:
    """At `x` `[term and clip]`."""
    value, gradient, information = -0.5 * float(x @ x), -x.copy(), np.eye(len(x))
    count = len(terms)
    widths = np.append([np.log(term.factor) for term in terms], np.full(len(clips), NOISE_SD))
    for index, clip in enumerate(clips):
        own = [k for k, term in enumerate(terms) if term.name in clip.of_terms] + [count + index]
        units = [*(clip.of_terms[terms[k].name] for k in own[:-1]), np.eye(len(clip.e))]
        parts = [np.exp(2 * widths[k] * x[k]) * unit for k, unit in zip(own, units, strict=True)]
        root = scipy.linalg.cholesky(clip.fixed + sum(parts), lower=True)
        (dpotri,) = scipy.linalg.get_lapack_funcs(("potri",), (root,))
        inverse = dpotri(root, lower=True)[0]
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        pulled = inverse @ clip.e
        value -= 0.5 * float(clip.e @ pulled) + float(np.log(np.diag(root)).sum())
        moved = np.stack([part @ pulled for part in parts], axis=1) * widths[own]
        volume = widths[own] * [np.sum(inverse * part) for part in parts]
        gradient[own] += pulled @ moved - volume
        information[np.ix_(own, own)] += 2 * moved.T @ inverse @ moved
    return _Look(value, gradient, information)

"""Sizes of imperfections, by what a fit leaves, in the linear model round it.

    e + J z ~ N(0, C(x)),    C = s^2 1 + U U^T + sum_k size_k^2 K_k,    z ~ N(0, 1)

in units of the stated tracking errors; e: the residuals that the fit would leave at z = 0. Sizes
are log-normal before the data: x_k = log(size_k / median_k) / log(factor_k) ~ N(0, 1), and so are
the noise scales s. With the parameters integrated out, e ~ N(0, C + J J^T). The most probable x
come by Newton steps with the average information, from where all sizes are at their medians and
from where one is larger and the others are smaller: an error may be brief or last long, and hardly
any track tells. What x may be is drawn by importance, from the prior, normal distributions round
these modes, and what fits these draws (`importance_sampling.py`).

Each clip of several is taken with parameters of its own, so that what differs from trial to trial
is not taken for roughness within one.

Source: Gilmour, Thompson and Cullis (1995), Average information REML, Biometrics 51, 1440; MacKay
(1992), Bayesian interpolation, Neural Computation 4, 415; Owen and Zhou (2000), Safe and effective
importance sampling, J. Am. Stat. Assoc. 95, 135.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import scipy.linalg
from jaxtyping import Float
from scipy.linalg.lapack import dpotrf, dpotri  # pyright: ignore[reportAttributeAccessIssue]
from scipy.special import logsumexp

from galileo_jax.inference.fits.importance_sampling import WeighedDraws
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.t_proposal import Cloud
from galileo_jax.inference.joint_problem import NOISE_SD, JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.inference.resampled import resampled
from galileo_jax.numerics.normal_matrix import inverse, symmetric_root
from galileo_jax.similarity.gaussian_likelihood import is_measured
from galileo_jax.statespace.sizes import Sizes
from galileo_jax.statespace.term import Term

MOST_VALUES = 300  # of a clip that tell sizes: of more, neighbours are averaged
MOST_STEPS, STILL, NEARLY = 60, 1e-4, 0.03  # steps that are left, of the best and of others
STILL_NATS = 1e-9
LEAST_DAMPING = 1e-6
LONGEST_STEP = 1.5  # of a log size, in units of its prior's width
LARGEST = 6.0
ASIDE = 1.5  # from the medians, of starts: one size larger, all others smaller
APART = 0.5  # modes that are nearer are one
NUM_TRIED, MOST_TRIED = 256, 2048  # at once, and in all where few of them count
ENOUGH_ESS = 1000.0  # the ends of an interval that hangs on sizes are then good to a tenth of an sd
NUM_DRAWS = 512  # that are kept
NUM_SCALES = 121  # of noise, over which is integrated
WIDER = 1.3  # than the normal approximation round a mode is what is drawn there


@dataclass(frozen=True)
class LinearClip:
    """What of one clip tells sizes and parameters."""

    e: Float[np.ndarray, " value"]  # residuals at z = 0
    slopes: Float[np.ndarray, "value parameter"]  # J, by the models' parameters; 0 where pinned
    # U U^T, the covariance whatever the sizes are
    fixed: Float[np.ndarray, "value value"]
    # by the term's name, K at the median
    of_terms: dict[str, Float[np.ndarray, "value value"]]

    def covariance(
        self, terms: Sequence[Term], x: np.ndarray, log_scale: float
    ) -> Float[np.ndarray, "value value"]:
        """C; `x` `[term]`, `log_scale` the noise scale's, in units of its prior's width."""
        size2 = {term.name: term.factor ** (2 * own) for term, own in zip(terms, x, strict=True)}
        found = self.fixed.copy()
        if self.of_terms:
            found += np.tensordot([size2.get(name, 0.0) for name in self.of_terms], self._every, 1)
        found[np.diag_indices_from(found)] += np.exp(2 * NOISE_SD * log_scale)
        return found

    @functools.cached_property
    def _every(self) -> Float[np.ndarray, "term value value"]:
        """All of `of_terms`."""
        return np.stack(list(self.of_terms.values()))


class Mode(NamedTuple):
    """Sizes round which others are less probable."""

    both: np.ndarray  # `[term and clip]`, log sizes and log noise scales
    value: float  # their log posterior
    information: np.ndarray  # `[term and clip, term and clip]`, average, the prior included
    count: int  # of terms

    @property
    def x(self) -> np.ndarray:
        """`[term]`, log sizes."""
        return self.both[: self.count]


def linear_clips(trials: JointProblem, fit: GradientFit) -> list[LinearClip]:
    """The clips round a fit, its residuals and slopes as they are."""
    theta, count = trials.theta(fit.z, fit.free), len(trials.model_parameters)
    found, first = [], 0
    for index, problem in enumerate(trials.problems):
        size = problem.observation.position_m.size
        scale = trials.noise_scale(theta, index)
        rows = fit.jacobian[first : first + size]
        first += size
        white = problem.whiten(problem.simulate(trials.of_clip(theta, index)), scale)
        every = np.column_stack([white - rows @ fit.z[:count], rows])
        # From whitened to units of the stated errors.
        gain = np.sqrt(scale**2 + problem.data.gain**2) - scale
        along = gain[:, None] * (problem.data.rows @ every)
        every = averaged((scale * every + problem.data.rows.T @ along).T, problem)
        modes = averaged(problem.fixed_patterns, problem)
        of_terms = {}
        for term, patterns in problem.patterns.items():
            own = averaged(patterns, problem)
            of_terms[term] = own.T @ own
        found.append(LinearClip(every[0], every[1:].T, modes.T @ modes, of_terms))
    return found


def averaged(values: np.ndarray, problem: Problem) -> Float[np.ndarray, "row value"]:
    """Rows of measured values; neighbours of many are averaged, independent errors staying so.

    `values`: `[row, ...]`, whitened, as many in each row as `Problem.whiten` gives. A place that is
    known along a line only is one value, not two.
    """
    seen = is_measured(problem.data.inverse_root)
    own = np.repeat(np.arange(seen.shape[0] * seen.shape[1]), seen.shape[2])[seen.reshape(-1)]
    values = values.reshape(len(values), -1)[:, seen.reshape(-1)]
    together = -(-len(own) // MOST_VALUES)
    if together < 2 or not len(values):
        return values
    rank = np.arange(len(own)) - np.searchsorted(own, own)
    starts = np.flatnonzero((rank % together == 0) | (np.diff(own, prepend=-1) > 0))
    number = np.diff(starts, append=len(own))
    return np.add.reduceat(values, starts, axis=1) / np.sqrt(number)


def most_probable(
    clips: Sequence[LinearClip],
    terms: Sequence[Term],
    starts: Sequence[np.ndarray] | None,
    fit: GradientFit,
) -> list[Mode]:
    """The most probable sizes first, and others to which starts lead.

    `terms`: that have a size, in the order of x. `starts`: `[term]` each; None: the medians and one
    term after the other. `fit`: its noise scales are where these begin.
    """
    if starts is None:
        aside = ASIDE * (2 * np.eye(len(terms)) - 1)
        starts = [np.zeros(len(terms)), *(aside if len(terms) > 1 else [])]
    scales = fit.z[len(fit.steps) :]
    marginal = [_without_parameters(clip) for clip in clips]
    found = [_climbed(marginal, terms, np.concatenate([x, scales]), NEARLY) for x in starts]
    modes: list[Mode] = []
    for mode in sorted(found, key=lambda one: -one.value):
        if all(np.abs(mode.both - other.both).max() > APART for other in modes):
            modes.append(mode)
    return [_climbed(marginal, terms, modes[0].both), *modes[1:]]


def expected_lead(clips: Sequence[LinearClip], modes: Sequence[Mode], fit: GradientFit) -> float:
    """Log evidence with sizes over that without, nats, by Laplace's method: round all modes.

    `modes`: as of `most_probable`. `fit`: its noise scales are where that of none begins.
    """
    none = _climbed([_without_parameters(clip) for clip in clips], (), fit.z[len(fit.steps) :])
    own = [mode.value - 0.5 * np.linalg.slogdet(mode.information)[1] for mode in modes]
    without = none.value - 0.5 * np.linalg.slogdet(none.information)[1]
    return float(np.asarray(logsumexp(own)) - without)


def _without_parameters(clip: LinearClip) -> LinearClip:
    """The clip with its parameters integrated out."""
    fixed = clip.fixed + clip.slopes @ clip.slopes.T
    return LinearClip(clip.e, clip.slopes[:, :0], fixed, clip.of_terms)


def _climbed(
    clips: Sequence[LinearClip], terms: Sequence[Term], both: np.ndarray, still: float = STILL
) -> Mode:
    """The mode above `both` `[term and clip]`; no step is left that is longer than `still`."""
    value, gradient, information = _look(clips, terms, both)
    damping = LEAST_DAMPING
    for _ in range(MOST_STEPS):
        step = np.linalg.solve(information + damping * np.eye(len(both)), gradient)
        step *= min(1.0, LONGEST_STEP / max(float(np.abs(step).max()), still))
        there = both + step
        there[: len(terms)] = np.clip(there[: len(terms)], -LARGEST, LARGEST)
        new = _look(clips, terms, there)
        if new[0] < value - STILL_NATS:
            damping *= 10
            continue
        moved, both, (value, gradient, information) = np.abs(there - both).max(), there, new
        damping = max(damping / 5, LEAST_DAMPING)
        if moved < still:
            break
    return Mode(both, value, information, len(terms))


def _look(
    clips: Sequence[LinearClip], terms: Sequence[Term], both: np.ndarray
) -> tuple[float, np.ndarray, np.ndarray]:
    """The log posterior of log sizes and noise scales, its gradient, its average information."""
    value, gradient, information = -0.5 * float(both @ both), -both.copy(), np.eye(len(both))
    count = len(terms)
    widths = np.append([np.log(term.factor) for term in terms], np.full(len(clips), NOISE_SD))
    for index, clip in enumerate(clips):
        own = [k for k, term in enumerate(terms) if term.name in clip.of_terms] + [count + index]
        units = [*(clip.of_terms[terms[k].name] for k in own[:-1]), np.eye(len(clip.e))]
        parts = [np.exp(2 * widths[k] * both[k]) * u for k, u in zip(own, units, strict=True)]
        root, failed = dpotrf(clip.fixed + sum(parts), lower=True)
        if failed:  # so far out that rounding leaves no covariance
            return -np.inf, gradient, information
        inverted = dpotri(root, lower=True)[0]
        inverted = np.tril(inverted) + np.tril(inverted, -1).T
        pulled = inverted @ clip.e
        value -= 0.5 * float(clip.e @ pulled) + float(np.log(np.diag(root)).sum())
        moved = np.stack([part @ pulled for part in parts], axis=1) * widths[own]
        volume = widths[own] * [np.sum(inverted * part) for part in parts]
        gradient[own] += pulled @ moved - volume
        information[np.ix_(own, own)] += 2 * moved.T @ inverted @ moved
    return value, gradient, information


def integrated(clips: Sequence[LinearClip], terms: Sequence[Term], modes: Sequence[Mode]) -> Sizes:
    """Sizes with draws of their posterior, and the evidence with all of them integrated.

    `modes`: the most probable first.
    """
    marginal = [_without_parameters(clip) for clip in clips]
    best, count = modes[0], len(terms)
    roots = [WIDER * symmetric_root(inverse(mode.information)) for mode in modes]
    wide = np.eye(len(best.both))  # of the prior; noise scales are known much better than by it
    wide[count:, count:] = 2 * roots[0][count:, count:]
    free = np.ones(len(wide), bool)
    means = [np.append(np.zeros(count), best.both[count:]), *(mode.both for mode in modes)]
    parts = [Cloud(*own, free, np.inf) for own in zip(means, [wide, *roots], strict=True)]
    shares, generator = np.full(len(parts), 1 / len(parts)), np.random.default_rng(0)
    made = WeighedDraws(parts, shares, free)
    while made.ess < ENOUGH_ESS and len(made.z) < MOST_TRIED:
        new = made.draw(generator, NUM_TRIED)
        values = np.array([_value(marginal, terms, each) for each in new])
        made.add(values - 0.5 * new.shape[1] * np.log(2 * np.pi))
    noise = np.linalg.slogdet(best.information[count:, count:])[1]
    at_best = best.value + 0.5 * float(best.x @ best.x) - 0.5 * float(noise)
    evidence = float(np.asarray(logsumexp(made.log_weights))) - np.log(len(made.z)) - at_best
    which = resampled(made.log_weights, NUM_DRAWS, np.random.default_rng(1))
    return Sizes(tuple(term.name for term in terms), best.x, made.z[which], evidence)


def _value(clips: Sequence[LinearClip], terms: Sequence[Term], both: np.ndarray) -> float:
    """`_look`'s value alone; -inf so far out that rounding leaves no covariance."""
    value, count = -0.5 * float(both @ both), len(terms)
    for index, clip in enumerate(clips):
        cover = clip.covariance(terms, both[:count], both[count + index])
        root, failed = dpotrf(cover, lower=True)
        if failed:
            return -np.inf
        white = scipy.linalg.solve_triangular(root, clip.e, lower=True)
        value -= 0.5 * float(white @ white) + float(np.log(np.diag(root)).sum())
    return value


def log_likelihood(
    clips: Sequence[LinearClip], terms: Sequence[Term], x: Float[np.ndarray, " term"]
) -> float:
    """Log p(y | x), parameters and noise scales integrated, up to a constant."""
    total, log_scale = 0.0, np.linspace(-LARGEST, LARGEST, NUM_SCALES)
    for clip in map(_without_parameters, clips):
        unit = np.eye(len(clip.e))
        values, vectors = np.linalg.eigh(clip.covariance(terms, x, 0.0) - unit)
        along2 = (vectors.T @ clip.e) ** 2
        cover = np.exp(2 * NOISE_SD * log_scale)[:, None] + np.maximum(values, 0.0)
        each = -0.5 * np.sum(np.log(cover) + along2 / cover, axis=1) - 0.5 * log_scale**2
        total += float(np.asarray(logsumexp(each)))
    return total

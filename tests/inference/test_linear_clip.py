"""Sizes of imperfections in the linear model: against sums over a grid, and dense algebra."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import logsumexp as scipy_logsumexp

from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.fits.laplace import GradientFit
from galileo_jax.inference.fits.linear_clip import (
    LinearClip,
    integrated,
    linear_clips,
    log_likelihood,
    most_probable,
)
from galileo_jax.inference.fits.residuals import Residuals
from galileo_jax.inference.joint_problem import NOISE_SD
from galileo_jax.inference.log_posterior import LogPosterior
from galileo_jax.runtime.precision import in_float64
from galileo_jax.search.fit import best_fit
from galileo_jax.search.imperfect import fit_worlds
from galileo_jax.statespace.term import Term
from tests.oracle_trials import make_trials
from tests.ramp_model import HIT

VALUES, SIZE_X = 60, 1.0
TERM = Term("lasts", "{size}", "m", lambda _: 1.0, 3.0, lambda _: np.zeros((0, 1, 1, 1)))


def logsumexp(values, axis=None):
    """As an array."""
    return np.asarray(scipy_logsumexp(values, axis=axis))


@pytest.fixture(scope="module")
def clip():
    """Values with white noise and errors that last, three times their median; two slopes."""
    rng = np.random.default_rng(4)
    apart = np.abs(np.subtract.outer(np.arange(VALUES), np.arange(VALUES)))
    unit = np.exp(-apart / 8.0)
    cover = np.eye(VALUES) + TERM.factor ** (2 * SIZE_X) * unit
    slopes = np.stack([np.ones(VALUES), np.linspace(-1, 1, VALUES)], axis=1) * 4.0
    e = np.linalg.cholesky(cover) @ rng.standard_normal(VALUES) + slopes @ rng.standard_normal(2)
    return LinearClip(e, slopes, np.zeros((VALUES, VALUES)), {"lasts": unit})


def brute(clip, x, n):
    """log N(e; 0, C + J J^T) - x^2 / 2 - n^2 / 2, written out."""
    cover = np.exp(2 * NOISE_SD * n) * np.eye(VALUES) + clip.slopes @ clip.slopes.T
    cover += TERM.factor ** (2 * x) * clip.of_terms["lasts"]
    square = clip.e @ np.linalg.solve(cover, clip.e)
    return -0.5 * (square + np.linalg.slogdet(cover)[1] + x * x + n * n)


def fit_like(count):
    """Enough of a fit to say where noise scales begin."""
    fit = object.__new__(GradientFit)
    object.__setattr__(fit, "z", np.zeros(count + 1))
    object.__setattr__(fit, "steps", np.zeros(count))
    return fit


def test_the_mode_the_draws_and_the_evidence_are_those_of_a_grid(clip):
    """Within .05 of the mode, .15 of the mean and the sd, .1 nats."""
    grid = np.linspace(-3, 4, 141)
    values = np.array([[brute(clip, x, n) for n in grid] for x in grid])
    modes = most_probable([clip], [TERM], None, fit_like(2))
    best = np.unravel_index(values.argmax(), values.shape)
    np.testing.assert_allclose(modes[0].both, grid[list(best)], atol=0.05)
    sizes = integrated([clip], [TERM], modes)
    weight = np.exp(logsumexp(values, axis=1) - logsumexp(values))
    mean = weight @ grid
    sd = np.sqrt(weight @ (grid - mean) ** 2)
    assert sizes.draws[:, 0].mean() == pytest.approx(mean, abs=0.15)
    assert sizes.draws[:, 0].std() == pytest.approx(sd, rel=0.25)
    step2 = (grid[1] - grid[0]) ** 2
    whole = logsumexp(values) + np.log(step2) - np.log(2 * np.pi)
    at_mode = logsumexp(values[best[0]]) + 0.5 * np.log(step2 / (2 * np.pi))
    at_mode += 0.5 * grid[best[0]] ** 2  # as a fit at these sizes has it
    assert sizes.log_evidence == pytest.approx(whole - at_mode, abs=0.1)


@pytest.mark.parametrize("smaller", [1e-2, 1e-9])
def test_errors_far_smaller_than_stated_leave_sizes_to_move(clip, smaller):
    """Their noise scale lies many prior sds away; beyond rounding nothing is probable."""
    white = np.sqrt(np.exp(-VALUES)) * np.linspace(-1, 1, VALUES)  # hardly any noise of its own
    own = LinearClip(clip.e + white, clip.slopes * 1e3, clip.fixed, clip.of_terms)
    start = fit_like(2)
    start.z[-1] = np.log(smaller) / NOISE_SD
    modes = most_probable([own], [TERM], None, start)
    assert modes[0].x[0] == pytest.approx(
        most_probable([own], [TERM], None, fit_like(2))[0].x[0], abs=0.1
    )
    assert np.isfinite(integrated([own], [TERM], modes).log_evidence)


def test_the_likelihood_of_sizes_integrates_the_noise(clip):
    """Differences between sizes as sums over the noise have them."""
    grid = np.linspace(-5, 5, 401)
    by_sum = [logsumexp([brute(clip, x, n) + 0.5 * x * x for n in grid]) for x in (0.0, 1.0, 2.0)]
    found = [log_likelihood([clip], [TERM], np.array([x])) for x in (0.0, 1.0, 2.0)]
    np.testing.assert_allclose(np.diff(found), np.diff(by_sum), atol=1e-6)


@in_float64
def test_the_density_over_one_size_is_that_of_the_fit():
    """Up to a constant; so what is integrated is the likelihood itself, no linear model of it."""
    world = fit_worlds(make_trials([HIT]), 0, may_be_exact=False).best
    fit, residuals = world.fit, Residuals(world.trials)
    assert fit.sizes is not None
    at_mode = np.concatenate([fit.sizes.x, np.zeros(1)])[None]
    object.__setattr__(fit.sizes, "draws", at_mode)
    rng = np.random.default_rng(0)
    z = fit.z + 0.7 * np.sqrt(np.diag(fit.covariance)) * rng.standard_normal((12, len(fit.z)))
    over_one, at_fit = (
        LogPosterior(world.trials, one, residuals)(z) for one in (fit, replace(fit, sizes=None))
    )
    np.testing.assert_allclose(over_one - at_fit, over_one[0] - at_fit[0], atol=1e-6)
    z[:, -1] = fit.z[-1]  # the noise of the fit
    costs = residuals.costs(fit.points(z))
    np.testing.assert_allclose(
        np.ptp(costs + LogPosterior(world.trials, fit, residuals)(z)), 0.0, atol=1e-4
    )


def test_many_rows_are_averaged_and_say_the_same_of_parameters():
    """The information on parameters of neighbours that were averaged is nearly that of all."""
    trials = make_trials([HIT])
    fit = best_fit(GradientFitter(trials), 0)
    [linear] = linear_clips(trials, fit)
    assert linear.slopes.shape == (len(linear.e), len(trials.model_parameters))
    cover = linear.covariance(trials.terms, np.full(len(trials.terms), -9.0), 0.0)
    own = fit.free[: len(trials.model_parameters)]
    slopes = linear.slopes[:, own]
    information = slopes.T @ np.linalg.solve(cover, slopes) + np.eye(own.sum())
    sd = np.sqrt(np.diag(np.linalg.inv(information)))
    scale = trials.theta(fit.z)[-1]
    whole = np.sqrt(np.diag(fit.covariance)[: len(own)][own])
    np.testing.assert_allclose(sd, whole, rtol=0.1 + abs(1 - scale))

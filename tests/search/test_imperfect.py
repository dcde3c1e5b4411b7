"""Sizes of imperfections: those that are there are found, those that are not cost little."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.inference.fits.gradient import Code, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.search.fit import best_fit
from galileo_jax.search.imperfect import fit_worlds
from galileo_jax.statespace.terms import TERMS
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

LASTS_S, SIZE_M = 0.25, 1e-3


@pytest.fixture(scope="module", autouse=True)
def precision():
    with in_64_bit():
        yield


@pytest.fixture(scope="module")
def smooth(precision):
    trials = make_trials([HIT])
    return trials, best_fit(GradientFitter(trials), 0)


def sd_of(trials, fit, name):
    return np.sqrt(fit.covariance[trials.names.index(name), trials.names.index(name)])


def test_what_is_not_there_costs_little(smooth):
    """A perfect track: every size is far below its median, intervals are hardly wider."""
    trials, plain = smooth
    world = fit_worlds(trials, 0, may_be_exact=False).best
    rough, fit = world.trials, world.fit
    assert fit.sizes is not None
    sizes = fit.sizes.by_name
    assert fit.code is Code.CONVERGED
    assert not fit.sizes.unusual
    assert sizes["friction_roughness"] < 0
    for name, truth in (("k1", HIT.friction[0]), ("k2", HIT.friction[1])):
        assert sd_of(rough, fit, name) < 2.0 * sd_of(trials, plain, name)
        where = trials.names.index(name)
        assert abs(rough.theta(fit.z)[where] - truth) < 0.02


def with_errors(trials: JointProblem) -> JointProblem:
    """Marks that are off by a millimetre for a quarter of a second, of both bodies and axes."""
    [problem] = trials.problems
    times, shape = problem.observation.times_s, problem.observation.position_m.shape
    apart = np.abs(times[:, None] - times)
    root = np.linalg.cholesky(np.exp(-apart / LASTS_S) + 1e-9 * np.eye(len(times)))
    errors = np.random.default_rng(5).standard_normal(shape) @ root.T
    seen = replace(problem.observation, position_m=problem.observation.position_m + SIZE_M * errors)
    return JointProblem((Problem(seen, problem.model, problem.engine, problem.name),))


def test_errors_that_last_are_found_and_widen_intervals(smooth):
    """Their size within its interval; without them the fit is contradicted and far too sure."""
    trials = with_errors(smooth[0])
    plain = best_fit(GradientFitter(trials), 0)
    world = fit_worlds(trials, 0, may_be_exact=False).best
    rough, fit = world.trials, world.fit
    assert plain.code is Code.MISFIT
    assert fit.code is Code.CONVERGED
    assert fit.sizes is not None
    problem, where = rough.problems[0], fit.sizes.names.index("lasting_error")
    term = next(term for term in rough.terms if term.name == "lasting_error")
    low, high = (
        problem.size(term, x) for x in np.quantile(fit.sizes.draws[:, where], [0.025, 0.975])
    )
    assert low < SIZE_M < high
    k1 = trials.names.index("k1")
    width = sd_of(rough, fit, "k1")
    assert (
        abs(fit.z[k1] - rough.parameters[k1].prior.inverse(np.array(HIT.friction[0]))) < 3 * width
    )
    assert width > 1.5 * sd_of(trials, plain, "k1")


def test_where_bodies_were_is_the_dense_conditional_mean_at_usual_sizes(smooth):
    """U_b U_b^T C^-1 r with C written out: bodies follow what they did, not what marks err by.

    Whatever sizes were found: else large ones would follow what no model explains.
    """
    world = fit_worlds(with_errors(smooth[0]), 0, may_be_exact=False).best
    [problem] = world.trials.problems
    predicted = problem.simulate(world.trials.of_clip(world.trials.theta(world.fit.z), 0))
    seen = problem.observation
    assert problem.sizes is not None
    own, every = [], [problem.fixed_patterns]
    for name, patterns in problem.patterns.items():
        every.append(patterns)
        own += [] if TERMS[name].is_of_marks else [patterns]
    count = seen.position_m.size
    of_bodies, of_all = (np.concatenate(p).reshape(-1, count) for p in (own, every))
    noise_m = np.sqrt(seen.covariance_m2[0, 0, 0, 0])  # alike and independent in every place
    left = (seen.position_m - predicted).reshape(-1) / noise_m
    dense = of_bodies.T @ of_bodies @ np.linalg.solve(np.eye(count) + of_all.T @ of_all, left)
    moved = (problem.followed(predicted) - predicted).reshape(-1) / noise_m
    np.testing.assert_allclose(moved, dense, atol=1e-3 * np.abs(dense).max())
    assert np.abs(dense).max() > 0.1

"""Levenberg-Marquardt steps inside the priors' edges."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given
from scipy.optimize import lsq_linear
from scipy.special import ndtr

from galileo_jax.inference.fits.gradient import GradientFitter, Settings
from galileo_jax.inference.fits.steps import (
    DAMPINGS,
    LEFT_OF_WAY,
    TRIED_DAMPING,
    TRIED_SHARE,
    Damped,
    Edges,
)
from galileo_jax.model.parameters import LogNormal, Normal, Parameter, Uniform
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

PARAMETERS = (
    Parameter("k", "1", Uniform(0.0, 1.0), 0.0),
    Parameter("drag", "kg/m", LogNormal(0.3, 1.2), 0.0, "effect"),
    Parameter("m", "kg", LogNormal(0.4, 0.7), 0.0),
    Parameter("tilt", "rad", Normal(0.0, 0.02), 0.0, "effect"),
)
EDGES = Edges.of(PARAMETERS)
Z = st.floats(-6, 6)
ALL = np.arange(len(DAMPINGS))[None]


def theta(z: np.ndarray) -> np.ndarray:
    return np.array([ndtr(z[0]), 0.3 * np.exp(1.2 * z[1]), z[2], z[3]])


@given(st.tuples(Z, Z, Z, Z), st.tuples(Z, Z, Z, Z))
def test_steps_are_straight_in_the_units_of_the_motion(at, step):
    z, step = np.array(at), np.array(step)
    step = np.clip(step, *EDGES.reach(z))
    slope = np.array([np.exp(-0.5 * z[0] ** 2) / np.sqrt(2 * np.pi), 1.2 * theta(z)[1], 1, 1])
    expected = theta(z) + slope * step
    np.testing.assert_allclose(theta(EDGES.curve(z, step)), expected, rtol=1e-6, atol=1e-14)


PRODUCT = (
    Parameter("k", "1", Uniform(0.0, 1.0), 0.0),
    Parameter("s", "1", LogNormal(1.0, 0.8), 0.0, "effect", multiplies="k"),
)


@given(st.tuples(Z, st.floats(-2, 2)), st.tuples(Z, Z))
def test_what_multiplies_friction_is_straight_in_their_product(at, step):
    edges, z = Edges.of(PRODUCT), np.array(at)
    step = np.clip(np.array(step), *edges.reach(z))
    k, s = ndtr(z[0]), np.exp(0.8 * z[1])
    dk, ds = np.exp(-0.5 * z[0] ** 2) / np.sqrt(2 * np.pi) * step[0], 0.8 * s * step[1]
    found = edges.curve(z, step)
    there = ndtr(found[0]) * np.exp(0.8 * found[1])
    least = (k + dk) * LEFT_OF_WAY * s
    np.testing.assert_allclose(there, max(k * s + k * ds + s * dk, least), rtol=1e-6, atol=1e-14)


def test_shares_are_of_the_steps_of_their_damping():
    jacobian = np.random.default_rng(0).normal(size=(1, 9, 3))
    endless = np.full((1, 1, 3), np.inf)
    damped = Damped.of(np.ones((1, 3), bool), [jacobian])
    every = np.arange(len(TRIED_SHARE))[None]
    steps = damped.steps(np.ones((1, 1, 3)), [np.ones((1, 1, 9))], (-endless, endless), every)[0]
    for step, damping, share in zip(steps, TRIED_DAMPING, TRIED_SHARE, strict=True):
        whole = steps[np.flatnonzero(damping == DAMPINGS)[0]]
        np.testing.assert_allclose(step, share * whole, rtol=1e-12)
    assert set(TRIED_SHARE) != {1.0}


@given(st.tuples(*[st.floats(-8, 8)] * 4), st.tuples(*[st.floats(-1e9, 1e9)] * 4))
def test_no_step_leaves_the_priors(at, step):
    found = EDGES.curve(np.array(at), np.array(step))
    assert np.isfinite(found).all()
    assert 0 < ndtr(found[0]) < 1


@given(st.integers(0, 10_000))
def test_with_one_edge_in_the_way_the_rest_is_solved_exactly(seed):
    rng = np.random.default_rng(seed)
    jacobian, white = rng.normal(size=(1, 12, 3)), rng.normal(size=(1, 1, 12))
    z = rng.normal(size=(1, 1, 3))
    low = np.array([[[-0.1, -np.inf, -np.inf]]])
    steps = Damped.of(np.ones((1, 3), bool), [jacobian]).steps(z, [white], (low, -low), ALL)
    for damping, step in zip(DAMPINGS, steps[0], strict=True):
        size = np.sqrt(damping * (1 + np.sum(jacobian[0] ** 2, axis=0)))
        rows = np.vstack([jacobian[0], np.eye(3), np.diag(size)])
        right = -np.concatenate([white[0, 0], z[0, 0], np.zeros(3)])
        best = lsq_linear(rows, right, bounds=(low[0, 0], -low[0, 0]), tol=1e-14).x
        np.testing.assert_allclose(step, best, atol=1e-6)


def test_pinned_parameters_stay():
    free = np.array([[True, False, True]])
    jacobian = np.random.default_rng(0).normal(size=(1, 9, 3))
    infinite = np.full((1, 1, 3), np.inf)
    damped = Damped.of(free, [jacobian])
    steps = damped.steps(np.zeros((1, 1, 3)), [np.ones((1, 1, 9))], (-infinite, infinite), ALL)
    assert np.all(steps[..., 1] == 0) and np.all(steps[:, 0, [0, 2]] != 0)


@pytest.mark.parametrize("edge", [-3.9, -3.0])
def test_a_fit_comes_back_from_the_edge(edge):
    """Where a coefficient of friction no longer moves with z."""
    with in_64_bit():
        trials = make_trials([HIT])
        fitter = GradientFitter(trials, Settings(num_exact=0))
        best = fitter.fit(0)
        count = len(trials.model_parameters)
        start = best.z[:count].copy()
        start[[p.name for p in trials.model_parameters].index("k1")] = edge
        (found,) = fitter.fit_from(start[None], best.free[None, :count], np.zeros(1, int))
    assert found.log_evidence == pytest.approx(best.log_evidence, abs=0.5)

"""A Gaussian-process acceleration: sizes by the marginal likelihood, and intervals that hold."""

import numpy as np
import pytest
from scipy.stats import kstest, norm, truncnorm

from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.free_force.discrepancy import fit_discrepancy
from galileo_jax.inference.free_force.kernels import (
    Knots,
    probable_sizes,
    unit_root,
    unit_roots,
)
from galileo_jax.inference.free_force.ridge import TABLE_Z, Frictions, friction_draws
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def knots(rng, size_m_s2, length, num=30):
    """Knots, and data with an acceleration of this size drawn of time."""
    time = np.linspace(0.0, 1.0, num)
    place = rng.permutation(time)
    response = 50.0 * rng.standard_normal((200, num))
    drawn = size_m_s2 * unit_root(time, length) @ rng.standard_normal(num)
    return Knots(response, time, place), response @ drawn + rng.standard_normal(200)


@pytest.mark.parametrize("size", [0.05, 0.5, 3.0])
def test_the_size_is_found(size):
    own, target = knots(np.random.default_rng(3), size, 0.2)
    sizes, share = probable_sizes(target, [own])
    mean = np.exp(share @ np.log([max(s.sizes_m_s2[0], 1e-3) for s in sizes]))
    assert mean == pytest.approx(size, rel=0.8)
    of_time = sum(p for s, p in zip(sizes, share, strict=True) if s.of == "time")
    assert of_time > 0.9


def test_of_noise_alone_none_is_the_most_probable_size():
    own, target = knots(np.random.default_rng(4), 0.0, 0.2)
    sizes, share = probable_sizes(target, [own])
    none = sum(p for s, p in zip(sizes, share, strict=True) if s.sizes_m_s2 == (0.0,))
    assert share.sum() == pytest.approx(1.0)
    assert none > 0.5


def test_the_covariance_has_a_constant_as_large_as_what_varies():
    root = unit_root(np.linspace(0.0, 1.0, 20), 0.1)
    covariance = root @ root.T
    np.testing.assert_allclose(np.diag(covariance), 2.0, rtol=1e-6)
    assert covariance[0, -1] == pytest.approx(1.0, abs=1e-3)


def test_all_objects_may_share_a_size():
    """One that shows nothing of itself is as free as the other, or has none."""
    own, target = knots(np.random.default_rng(3), 0.5, 0.2)
    unseen = Knots(np.zeros((200, 8)), np.linspace(0.4, 0.5, 8), np.linspace(0.4, 0.5, 8))
    sizes, share = probable_sizes(target, [own, unseen])
    same = sum(p for s, p in zip(sizes, share, strict=True) if len(set(s.sizes_m_s2)) == 1)
    none = sum(p for s, p in zip(sizes, share, strict=True) if s.sizes_m_s2[1] == 0.0)
    assert (same, none) == (pytest.approx(0.5, abs=0.05), pytest.approx(0.25, abs=0.02))


def test_lengths_are_those_of_the_longest_motion():
    """In a tenth of the time a slow force is a constant."""
    longest = np.linspace(0.0, 1.0, 20)
    short = np.linspace(0.5, 0.6, 8)
    pair = [Knots(np.zeros((1, len(t))), t, t) for t in (longest, short)]
    roots = unit_roots(pair, "time", 0.4)
    covariance = roots[1] @ roots[1].T
    assert covariance.min() > 1.9
    assert (roots[0] @ roots[0].T).min() < 1.2


@pytest.mark.parametrize("sd", [0.001, 0.05, 0.4])
def test_friction_on_a_ridge_is_drawn_by_its_prior(sd):
    """Uniform from 0 to 1, known to within `sd` of 0.1, however z bends."""
    table = np.clip(norm.cdf(TABLE_Z), 0.0, 1.0)
    frictions = Frictions(np.array([0]), table[None])
    power, pull = np.array([[sd**-2]]), np.array([-0.1 * sd**-2])
    z = friction_draws(frictions, np.zeros(1), power, pull, 2000, np.random.default_rng(5))
    found = frictions.value(z)[:, 0]
    expected = truncnorm(-0.1 / sd, 0.9 / sd, 0.1, sd)
    assert kstest(found, expected.cdf).statistic < 0.06


@pytest.mark.slow
def test_where_nothing_is_missing_the_fit_stays():
    trials = make_trials([HIT])
    fit = GradientFitter(trials).fit(seed=0)
    found = fit_discrepancy(trials, fit.z, fit.free, seed=0)
    again = fit_discrepancy(trials, fit.z, fit.free, seed=0)
    np.testing.assert_array_equal(found.posterior.draws, again.posterior.draws)
    k1 = found.posterior["k1"].ravel()
    low, high = np.quantile(k1, [0.025, 0.975])
    assert low <= HIT.friction[0] <= high
    plain = fit.covariance[trials.names.index("k1"), trials.names.index("k1")] ** 0.5
    wide = found.free.covariance
    at = found.free.trials.names.index("k1")
    assert wide[at, at] ** 0.5 > plain
    assert np.isfinite(wide).all()

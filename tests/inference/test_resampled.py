"""Draws out of weighed ones."""

import numpy as np
import pytest

from galileo_jax.inference.resampled import resampled, truncated, worth

COUNT = 700


def log_weights(size: int = 50) -> np.ndarray:
    return np.random.default_rng(4).normal(0.0, 2.0, size) - 1000.0


def expected(log_weights: np.ndarray) -> np.ndarray:
    share = np.exp(log_weights + 1000.0)
    return COUNT * share / share.sum()


def test_each_comes_in_as_often_as_it_weighs_give_or_take_one():
    which = resampled(log_weights(), COUNT, np.random.default_rng(5))
    assert len(which) == COUNT
    assert (abs(np.bincount(which, minlength=50) - expected(log_weights())) < 1).all()


def test_equal_weights_and_one_that_has_all():
    equal = resampled(np.zeros(COUNT), COUNT, np.random.default_rng(6))
    assert sorted(equal) == list(range(COUNT))
    one = resampled(np.array([-np.inf, 0.0, -800.0]), COUNT, np.random.default_rng(6))
    assert (one == 1).all()


def test_on_average_as_often_as_it_weighs():
    """Also where most draws weigh less than one."""
    own = log_weights(3000)
    times = np.zeros(len(own))
    for seed in range(400):
        which = resampled(own, COUNT, np.random.default_rng(seed))
        times += np.bincount(which, minlength=len(own))
    wanted = expected(own)
    error = (times / 400 - wanted) / np.sqrt(np.maximum(wanted, 1e-3) / 400)
    assert np.abs(error).max() < 6
    groups = np.array_split(np.argsort(own), 10)
    for group in groups:
        all_ = wanted[group].sum()
        assert times[group].sum() / 400 == pytest.approx(all_, abs=4 * np.sqrt(all_ / 400))


def test_weights_of_another_processor_choose_the_same_draws():
    own = log_weights(3000)
    other = own + 1e-6 * np.random.default_rng(7).standard_normal(len(own))
    one, two = (resampled(each, COUNT, np.random.default_rng(8)) for each in (own, other))
    assert (np.bincount(one, minlength=3000) != np.bincount(two, minlength=3000)).sum() <= 2


def test_the_first_few_are_a_sample_and_hardly_change():
    own = log_weights(3000)
    other = own + 1e-3 * np.random.default_rng(7).standard_normal(len(own))
    one, two = (resampled(each, COUNT, np.random.default_rng(9))[:100] for each in (own, other))
    assert len(set(one) & set(two)) > 0.9 * len(set(one))
    above = own > np.median(own[one])
    assert np.mean(above[resampled(own, COUNT, np.random.default_rng(10))[:100]]) < 0.75


def test_no_draw_has_more_than_its_share_of_the_weight():
    """And where weights are alike, none is cut; what is cut is nothing beside many draws."""
    size = 400
    alike = np.random.default_rng(7).normal(0.0, 0.3, size)
    np.testing.assert_array_equal(truncated(alike), alike)
    outlier = np.append(np.zeros(size - 1), 30.0) - 1000.0
    cut = truncated(outlier)
    assert cut[-1] < outlier[-1] and (cut[:-1] == outlier[:-1]).all()
    heavy = np.random.default_rng(8).normal(0.0, 3.0, 3000)
    assert worth(truncated(heavy)) > 3 * worth(heavy)


def test_what_weighed_draws_are_worth():
    assert worth(np.full(50, -1000.0)) == pytest.approx(50)
    assert worth(np.array([0.0, -np.inf, 0.0])) == pytest.approx(2)
    assert worth(np.array([0.0, -800.0])) == pytest.approx(1)

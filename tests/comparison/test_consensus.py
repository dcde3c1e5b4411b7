"""What a class finds together and who lies outside: by hand, and how often by chance."""

import numpy as np
import pytest
from scipy.stats import t

from galileo_jax.comparison.consensus import LEVEL, consensus

CLASSES, GROUPS = 200, 8
# Who is left out of tau is chosen by tau: measured, 5 to 8 % of classes, and a chance of that.
MOST = 2 * LEVEL + 2 * np.sqrt(2 * LEVEL / CLASSES)


def test_equal_uncertainties_by_hand():
    """Of equal s: tau^2 = variance - s^2, mu the mean, its variance (s^2 + tau^2) / n."""
    values = np.array([1.0, 2.0, 4.0, 5.0])  # mean 3, variance 10/3
    found = consensus(values, np.full(4, 1.0))
    assert found.mean == pytest.approx(3.0)
    assert found.scatter == pytest.approx(np.sqrt(10 / 3 - 1), abs=1e-6)
    assert found.sd == pytest.approx(np.sqrt(10 / 12), abs=1e-6)
    # Without the first: mean 11/3, variance 7/3; its own value has the variance 7/3, too.
    assert found.others[0] == pytest.approx(11 / 3)
    assert found.t[0] == pytest.approx((1 - 11 / 3) / np.sqrt(7 / 3 + 7 / 9), abs=1e-6)
    assert not found.is_outside.any()


def test_unequal_uncertainties_without_scatter_by_hand():
    """Weights 1/s^2: 100, 25, 25; Q = 0.1 < 2, so that tau is 0."""
    found = consensus(np.array([0.30, 0.31, 0.29]), np.array([0.1, 0.2, 0.2]))
    assert found.scatter == 0.0
    assert found.mean == pytest.approx(0.30)
    assert found.sd == pytest.approx(150**-0.5)


def test_the_border_is_that_of_students_t():
    """Of three others without scatter, mean 0 and s = 1: t = y / sqrt(1 + 1/3), two degrees."""
    border = t.isf(LEVEL / 2 / 4, 2) * np.sqrt(4 / 3)
    for factor, is_outside in ((0.99, False), (1.01, True)):
        found = consensus(np.array([-0.1, 0.0, 0.1, factor * border]), np.ones(4))
        assert list(found.is_outside) == [False, False, False, is_outside]


@pytest.mark.parametrize("scatter", [0.0, 1.0, 5.0])
def test_in_few_classes_somebody_is_marked_who_is_right(scatter):
    random = np.random.default_rng(3)
    sds = random.uniform(0.5, 1.5, (CLASSES, GROUPS))
    values = random.normal(0.0, np.hypot(sds, scatter))
    marked = [consensus(y, s).is_outside.any() for y, s in zip(values, sds, strict=True)]
    assert np.mean(marked) <= MOST


def test_several_that_are_wrong_do_not_hide_each_other():
    random = np.random.default_rng(1)
    values = random.normal(0.3, 0.01, 30)
    values[[3, 8, 20, 25]] += 0.09  # a ramp of 25 degrees that is declared to have 20
    found = consensus(values, np.full(30, 0.002))
    marked = {*np.flatnonzero(found.is_outside)}
    assert {3, 8, 20, 25} <= marked and len(marked) <= 5
    assert abs(found.mean - 0.3) < 2 * found.sd < 0.01


def test_groups_that_agree_to_the_last_digit():
    found = consensus(np.full(5, 0.2), np.full(5, 0.01))
    assert (found.mean, found.scatter) == (pytest.approx(0.2), 0.0)
    assert not found.is_outside.any()

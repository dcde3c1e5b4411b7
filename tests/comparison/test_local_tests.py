"""The statistics of a cell are numbers, whatever is in it."""

import numpy as np
import pytest

from galileo_jax.comparison.local_tests import Cell, statistics

CELL = Cell(0, "object1", "x", "rest", np.arange(20))


def test_residuals_that_are_exactly_zero_follow_nothing():
    """Rows of a track that stand still, of an object that does."""
    noise = np.random.default_rng(1).standard_normal(20)
    still, moved = statistics(np.stack([np.zeros(20), noise]), CELL, 0.0)
    np.testing.assert_array_equal(still, 0.0)
    assert np.isfinite(moved).all() and (moved[:2] > 0).all()


def test_where_noise_alternates_less_of_it_is_no_memory():
    """What the likelihood takes up leaves residuals that alternate; with less noise, and some that
    do not, neighbours would seem to go together."""
    rng = np.random.default_rng(3)
    alternates = rng.standard_normal((400, 21))
    alternates = alternates[:, 1:] - alternates[:, :-1]
    least = float(np.mean(np.sum(alternates**2, axis=1)))
    usual = float(np.mean(np.sum(alternates[:, 1:] * alternates[:, :-1], axis=1))) / least
    assert usual == pytest.approx(-0.475, abs=0.02)  # -1/2, of 19 pairs in 20 values
    spread = statistics(alternates, CELL, least, usual)[:, 2].std()
    quiet = 0.4 * rng.standard_normal((400, 20))  # that do not alternate
    from_zero = statistics(alternates, CELL, least)[:, 2].mean()
    as_if_white = statistics(quiet, CELL, least)[:, 2] - from_zero
    beside_usual = statistics(quiet, CELL, least, usual)[:, 2]
    assert np.median(as_if_white) > 3 * spread
    assert np.median(beside_usual) < 1.0 * spread
    loud = statistics(5 * quiet, CELL, least, usual)[:, 2]
    assert np.median(loud) > 3 * spread

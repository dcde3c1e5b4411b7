"""The statistics of a cell are numbers, whatever is in it."""

import numpy as np

from galileo_jax.comparison.local_tests import Cell, statistics

CELL = Cell(0, "object1", "x", "rest", np.arange(20))


def test_residuals_that_are_exactly_zero_follow_nothing():
    """Rows of a track that stand still, of an object that does."""
    noise = np.random.default_rng(1).standard_normal(20)
    still, moved = statistics(np.stack([np.zeros(20), noise]), CELL, 0.0)
    np.testing.assert_array_equal(still, 0.0)
    assert np.isfinite(moved).all() and (moved[:2] > 0).all()

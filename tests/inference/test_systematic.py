"""Draws out of weighed ones."""

import numpy as np

from galileo_jax.inference.systematic import systematic


def test_each_comes_in_as_often_as_it_weighs_give_or_take_one():
    rng = np.random.default_rng(4)
    log_weights = rng.normal(0.0, 2.0, 50) - 1000.0
    share = np.exp(log_weights + 1000.0)
    which = systematic(log_weights, 700, rng)
    assert (np.diff(which) >= 0).all() and len(which) == 700
    times = np.bincount(which, minlength=50)
    assert (abs(times - 700 * share / share.sum()) < 1).all()

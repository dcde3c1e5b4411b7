"""Replicates are data of the model: refitted or not, no worse than their own noise."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.comparison.bootstrap import replicates
from galileo_jax.inference.fits.gradient import GradientFitter
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

COUNT = 64


@pytest.fixture(scope="module")
def fitted():
    with in_64_bit():
        trials = make_trials([HIT])
        return trials, GradientFitter(trials).fit(0)


def per_value(trials, fit):
    with in_64_bit():
        (white,) = replicates(trials, fit, np.ones(1), COUNT, seed=0)
    return np.sum(white**2, axis=1) / trials.num_values


def test_refitted_replicates_have_the_noise_that_fits_leave(fitted):
    trials, fit = fitted
    free = np.count_nonzero(fit.free)
    left = per_value(trials, fit)
    assert np.mean(left) == pytest.approx(1.0 - free / trials.num_values, abs=0.1)


def test_a_jacobian_that_does_not_hold_makes_no_wild_replicates(fitted):
    """Steps ten times too far: before, they were taken, and nothing stood out beside them."""
    trials, fit = fitted
    left = per_value(trials, replace(fit, jacobian=0.1 * fit.jacobian))
    assert np.max(left) < 1.5

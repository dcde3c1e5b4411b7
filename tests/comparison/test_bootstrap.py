"""Replicates are data of the model: refitted as the data were, never worse than their own noise."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.comparison import bootstrap
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


def squares(trials, fit, num_steps=bootstrap.NUM_STEPS):
    """Sums of the replicates' squared residuals after so many steps of the refit."""
    with in_64_bit(), pytest.MonkeyPatch.context() as patch:
        patch.setattr(bootstrap, "NUM_STEPS", num_steps)
        (white,) = bootstrap.replicates(trials, fit, np.ones(1), [1.0], COUNT, 0)
    return np.sum(white**2, axis=1)


@pytest.fixture(scope="module")
def noise(fitted):
    """Of the same replicates, not refitted."""
    return squares(*fitted, num_steps=0)


def test_without_a_refit_they_are_unit_noise(fitted, noise):
    trials, _ = fitted
    sd = np.sqrt(2 * trials.num_values / COUNT)
    assert np.mean(noise) == pytest.approx(trials.num_values, abs=3 * sd)


def test_a_refit_takes_up_what_the_parameters_are_free_to(fitted, noise):
    """As many values' worth of noise as the fit has used: tr J (J'J + 1)^-1 J'.

    Of the same noise before and after, so that its own scatter, far larger, drops out; what is
    left is that of a chi square with so many degrees of freedom.
    """
    trials, fit = fitted
    taken = noise - squares(trials, fit)
    sd = np.sqrt(2 * fit.num_used / COUNT)
    assert np.mean(taken) == pytest.approx(fit.num_used, abs=3 * sd)


def test_they_are_refitted_to_the_end(fitted):
    """One step more changes hardly anything, one less does no better."""
    usual = bootstrap.NUM_STEPS
    less, own, more = (squares(*fitted, num_steps=usual + change) for change in (-1, 0, 1))
    assert np.mean(np.abs(more - own)) < 0.05
    assert np.mean(own) <= np.mean(less) + 0.05


def test_a_jacobian_that_does_not_hold_makes_no_wild_replicates(fitted, noise):
    """Steps ten times too far: before, they were taken, and nothing stood out beside them."""
    trials, fit = fitted
    left = squares(trials, replace(fit, jacobian=0.1 * fit.jacobian))
    # A step is only taken if it lowers the cost, in which the prior counts as well.
    assert np.max(left - noise) < 3 * np.count_nonzero(fit.free)

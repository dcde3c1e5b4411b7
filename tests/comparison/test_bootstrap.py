"""Replicates are data of the model: refitted as the data were, never worse than their own noise."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.clip.track_noise import position_noise_m
from galileo_jax.comparison import bootstrap
from galileo_jax.comparison.phases import phases
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.search.fit import best_fit
from tests.oracle_trials import make_trials, observe
from tests.ramp_model import HIT

COUNT = 64


@pytest.fixture(scope="module")
def fitted():
    trials = make_trials([HIT])
    return trials, best_fit(GradientFitter(trials), 0)


def squares(trials, fit, num_steps=bootstrap.NUM_STEPS, costs=None):
    """Sums of the replicates' squared residuals after so many steps of the refit.

    `costs`, if given, gets what the refit minimises: these and the prior's squares.
    """
    refitted = bootstrap._refitted

    def recorded(*args):
        best, cost = refitted(*args)
        if costs is not None:
            costs.append(np.mean(cost))
        return best, cost

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(bootstrap, "NUM_STEPS", num_steps)
        patch.setattr(bootstrap, "_refitted", recorded)
        labels = [phases(trials.problems[0], trials.theta(fit.z, fit.free))]
        (white,) = bootstrap.replicates(trials, fit, np.ones(1), [1.0], labels, COUNT, 0)
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
    usual, costs = bootstrap.NUM_STEPS, []
    _, own, more = (
        squares(*fitted, num_steps=usual + change, costs=costs) for change in (-1, 0, 1)
    )
    assert np.mean(np.abs(more - own)) < 0.05
    less_cost, own_cost, more_cost = costs
    assert own_cost <= less_cost + 0.05 and more_cost == pytest.approx(own_cost, abs=0.05)


def test_a_jacobian_that_does_not_hold_makes_no_wild_replicates(fitted, noise):
    """Steps ten times too far: before, they were taken, and nothing stood out beside them."""
    trials, fit = fitted
    left = squares(trials, replace(fit, jacobian=0.1 * fit.jacobian))
    # A step is only taken if it lowers the cost, in which the prior counts as well.
    assert np.max(left - noise) < 3 * np.count_nonzero(fit.free)


def test_errors_of_a_tracker_are_as_uneven_as_they_are_known_to_be():
    """Of a stretch all errors are alike; over replicates their mean square is 1."""
    seen = replace(observe(HIT, 0), noise_known_to=0.5)
    label = np.repeat([[0, 1], [2, 1]], seen.mask.shape[1] // 2, axis=1)
    label = np.pad(label, ((0, 0), (0, seen.mask.shape[1] % 2)), mode="edge")
    drawn = bootstrap._uneven(seen, label, 4000, np.random.default_rng(0))
    each = drawn.reshape(4000, *seen.position_m.shape)
    for i in range(2):
        for phase in np.unique(label[i]):
            own = each[:, i, :, label[i] == phase]
            assert (own == own[:1]).all()
    assert (each[:, 0, 0, 0] != each[:, 0, 1, 0]).all(), "each axis has its own"
    assert np.mean(drawn**2) == pytest.approx(1.0, abs=0.03)
    assert np.std(2 * np.log(each[:, 1, 0, 0])) == pytest.approx(0.5, abs=0.02)


def test_errors_told_by_roughness_are_known_to_no_better_than_their_rows_tell():
    """Of a coordinate all are alike; what is drawn scatters as the estimator does."""
    seen = replace(observe(HIT, 0), rows_of_noise=100)
    label = np.tile(np.arange(seen.mask.shape[1]) // 10, (2, 1))
    drawn = bootstrap._uneven(seen, label, 4000, np.random.default_rng(0))
    each = drawn.reshape(4000, *seen.position_m.shape)
    assert (each == each[..., :1]).all()
    generator, times = np.random.default_rng(1), np.arange(100) / 60
    told = [position_noise_m(times, generator.standard_normal(100)) for _ in range(1000)]
    assert np.std(np.log(each[:, 0, 0, 0])) == pytest.approx(np.std(np.log(told)), rel=0.1)

"""The gradient fit, against tracks in closed form: truths, joint clips, pinned effects."""

from dataclasses import replace
from math import radians

import numpy as np
import pytest

from galileo_jax.inference.fits.gradient import Code, GradientFitter
from galileo_jax.inference.laplace import laplace_posterior
from galileo_jax.model.effects.registry import make_effects
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

SIGMAS = 4.0
STEEPER = replace(HIT, angle_rad=radians(25), release_m=0.4)
PUSHES = replace(HIT, mass_kg=(0.3, 0.5), friction=(0.22, 0.1))
QUANTITIES = ("k1", "k2", "log_mass_ratio")


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def fit(trials, effects=None):
    return GradientFitter(trials).fit(0, effects=effects)


def told(trials, found):
    """Mean and standard deviation of what a clip determines, by name."""
    posterior = laplace_posterior(trials, found, 0)
    draws = {name: posterior[name] for name in ("k1", "k2")}
    draws["log_mass_ratio"] = np.log(posterior["m1"] / posterior["m2"])
    return {name: (float(d.mean()), float(d.std())) for name, d in draws.items()}


@pytest.fixture(scope="module")
def alone():
    """One clip of `HIT`."""
    with in_64_bit():
        trials = make_trials([HIT])
        return trials, fit(trials)


def check_truth(experiment, trials, found):
    (m1, m2), (k1, k2) = experiment.mass_kg, experiment.friction
    for name, truth in zip(QUANTITIES, (k1, k2, np.log(m1 / m2)), strict=True):
        mean, sd = told(trials, found)[name]
        assert abs(mean - truth) < SIGMAS * sd, name


def test_the_truth_comes_back(alone):
    trials, found = alone
    assert found.code is Code.CONVERGED
    check_truth(HIT, trials, found)
    count = trials.num_values
    assert 0.5 * count < found.chi2 < 1.2 * count, "modes take up some of the values"
    assert abs(told(trials, found)["k1"][0] - HIT.friction[0]) < 0.005


def test_the_truth_comes_back_where_objects_part():
    trials = make_trials([PUSHES])
    check_truth(PUSHES, trials, fit(trials))


def test_same_seed_same_fit(alone):
    trials, found = alone
    again = fit(trials)
    np.testing.assert_array_equal(again.z, found.z)
    np.testing.assert_array_equal(again.covariance, found.covariance)


def test_two_clips_tell_more_than_one(alone):
    trials = make_trials([HIT, STEEPER])
    found = fit(trials)
    check_truth(HIT, trials, found)
    spread = {name: sd for name, (_, sd) in told(trials, found).items()}
    before = {name: sd for name, (_, sd) in told(*alone).items()}
    assert all(spread[name] < before[name] for name in QUANTITIES), (spread, before)


@pytest.fixture(scope="module")
def library():
    """The same clip; its model could have air drag."""
    return make_trials([HIT], effects=make_effects(("air_drag",)))


@pytest.fixture(scope="module")
def pinned(library):
    with in_64_bit():
        return fit(library, effects=())


def test_pinned_effects_are_the_base_model(alone, library, pinned):
    """The same mode, covariance and evidence, though the model has more in it."""
    trials, found = alone
    free = pinned.free
    kept = [name for name, is_free in zip(library.names, free, strict=True) if is_free]
    assert kept == list(trials.names)
    assert (pinned.z[~free] == 0).all()
    assert (pinned.covariance[~free] == 0).all()
    sd = np.sqrt(np.diag(found.covariance))
    assert np.abs((pinned.z[free] - found.z) / sd).max() < 0.2
    np.testing.assert_allclose(np.sqrt(np.diag(pinned.covariance)[free]), sd, rtol=0.1)
    assert pinned.log_evidence == pytest.approx(found.log_evidence, abs=0.5)


def test_the_evidence_prefers_the_simpler_of_two_that_fit(library, pinned):
    """Air drag adds nothing to a world without it, and costs Occam's factor."""
    with_drag = fit(library, effects=("air_drag",))
    assert with_drag.free.all()
    assert pinned.log_evidence > with_drag.log_evidence

"""The gradient fit, against tracks in closed form: truths, joint clips, pinned effects."""

from dataclasses import replace
from math import radians

import jax.numpy as jnp
import numpy as np
import pytest

from galileo_jax.inference.fit_posterior import laplace_posterior
from galileo_jax.inference.fits import gradient
from galileo_jax.inference.fits.gradient import Code, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.model.effects.registry import make_effects
from galileo_jax.model.parameters import inverse
from galileo_jax.rollout.engines import make_engine
from galileo_jax.search.fit import best_fit
from tests.oracle_trials import make_trials
from tests.precision import in_64_bit
from tests.ramp_model import HIT

SIGMAS = 4.0
# How far estimates of k1, k2 and log(m1 / m2) scatter round the truth over tracks that differ in
# the tracker's noise alone (root mean square over 16 seeds, each fitted from scratch). What else
# the likelihood allows for, and so the posterior's own sd, is wider: by no more than so much.
SCATTER_HIT = (4.3e-4, 8.8e-4, 6.9e-3)
SCATTER_PUSHES = (1.9e-4, 4.9e-3, 2.7e-2)
NARROWEST, WIDEST = 0.8, 3.0
STEEPER = replace(HIT, angle_rad=radians(25), release_m=0.4)
PUSHES = replace(HIT, mass_kg=(0.3, 0.5), friction=(0.22, 0.1))
QUANTITIES = ("k1", "k2", "log_mass_ratio")


@pytest.fixture(autouse=True)
def precision():
    with in_64_bit():
        yield


def fit(trials, effects=None):
    return best_fit(GradientFitter(trials), 0, effects=effects)


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


STANDS_STILL_SD = 1e-4  # ten times what the fit asks for


def check_truth(experiment, scatter, trials, found):
    """Estimates are as near to the truth as the noise lets them be, and their sd says so."""
    (m1, m2), (k1, k2) = experiment.mass_kg, experiment.friction
    truths = (k1, k2, np.log(m1 / m2))
    for name, truth, noise in zip(QUANTITIES, truths, scatter, strict=True):
        mean, sd = told(trials, found)[name]
        assert abs(mean - truth) < SIGMAS * noise, name
        assert NARROWEST * noise < sd < WIDEST * noise, name


def fit_from_truth(experiment, trials):
    """Refined from the truth itself: what a search that starts anywhere must at least find."""
    values = {"m1": experiment.mass_kg[0], "m2": experiment.mass_kg[1]}
    values |= {"k1": experiment.friction[0], "k2": experiment.friction[1]}
    parameters = trials.model_parameters
    theta = np.array([values.get(p.name, p.absent) for p in parameters])
    start = np.clip(np.asarray(inverse(parameters, jnp.asarray(theta))), -1.0, 1.0)[None]
    return GradientFitter(trials).fit_from(start, np.ones(start.shape, bool), np.zeros(1, int))[0]


def test_the_truth_comes_back(alone):
    trials, found = alone
    assert found.code is Code.CONVERGED
    check_truth(HIT, SCATTER_HIT, trials, found)
    (problem,) = trials.problems
    left = problem.data.degrees(1.0) - found.num_used
    assert 0.7 * left < found.chi2 < 1.3 * left < 0.7 * trials.num_values
    assert found.log_evidence > fit_from_truth(HIT, trials).log_evidence - 0.2


def test_the_truth_comes_back_where_objects_part():
    trials = make_trials([PUSHES])
    found = fit(trials)
    check_truth(PUSHES, SCATTER_PUSHES, trials, found)
    assert found.log_evidence > fit_from_truth(PUSHES, trials).log_evidence - 0.2


def test_same_seed_same_fit(alone):
    trials, found = alone
    again = fit(trials)
    np.testing.assert_array_equal(again.z, found.z)
    np.testing.assert_array_equal(again.covariance, found.covariance)


def test_other_starts_lead_to_the_same_mode(alone):
    """A fit stands still to far less than its sd: the way to it leaves no trace."""
    trials, found = alone
    other = best_fit(GradientFitter(trials), 1)
    sd = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose(other.z / sd, found.z / sd, atol=STANDS_STILL_SD)
    assert other.log_evidence == pytest.approx(found.log_evidence, abs=1e-4)


def test_two_clips_tell_more_than_one(alone):
    trials = make_trials([HIT, STEEPER])
    found = fit(trials)
    check_truth(HIT, SCATTER_HIT, trials, found)
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


@pytest.mark.parametrize("engine", ["rigid", "c"])
def test_only_engines_in_jax_are_called_side_by_side(engine, monkeypatch):
    """MuJoCo's keep one set of simulations for all batches of a size: two threads would mix."""
    (problem,) = make_trials([HIT]).problems
    model = problem.model
    trials = JointProblem((replace(problem, engine=make_engine(engine, model)),))
    at_once = []
    monkeypatch.setattr(gradient, "side_by_side", at_once.extend)
    GradientFitter(trials).compile()
    assert len(at_once) == (2 if engine == "rigid" else 0)

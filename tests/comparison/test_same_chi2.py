"""`fit`, `compare` and `diagnose` say one and the same chi2 per degree of freedom."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.comparison import compare as module
from galileo_jax.comparison.compare import compare
from galileo_jax.inference.fit_posterior import laplace_posterior
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.result import make_result
from tests.comparison.test_calibration import disturbed, fit_near_truth
from tests.oracle_trials import make_trials
from tests.ramp_model import HIT

SAME = 1e-6


def wrong_model():
    """A centimetre to and fro: the fitted noise scale is far above what noise explains."""
    trials = make_trials([HIT])
    times = trials.problems[0].observation.times_s
    away = np.zeros((2, 2, len(times)))
    away[0, 0] = 0.01 * np.sin(20 * times)
    return disturbed(trials, away)


def cautious_tracker():
    """The tracker says 1.6 times the noise that there is."""
    (problem,) = make_trials([HIT]).problems
    seen = problem.observation
    told = replace(seen, covariance_m2=1.6**2 * seen.covariance_m2)
    return JointProblem((replace(problem, observation=told),))


@pytest.mark.parametrize("make", [wrong_model, cautious_tracker])
def test_fit_and_compare_say_the_same(make, monkeypatch):
    monkeypatch.setattr(module, "NUM_REPLICATES", 8)
    trials = make()
    fit = fit_near_truth(trials)
    compared = compare(trials, fit, 0)
    fitted = make_result(
        trials,
        laplace_posterior(trials, fit, 0),
        fit.z,
        clips=["a.csv"],
        method="grad",
        seed=0,
        timings_s={},
        notes={},
        num_fitted=fit.num_fitted,
    )["error"]
    for name, value in compared.error.items():
        assert fitted[name] == pytest.approx(value, rel=SAME), name
    whole = [place for place in compared.where if place.phase == "whole"]
    noise = np.sqrt(np.mean([place.noise**2 for place in whole]))
    assert noise == pytest.approx(fitted["noise"], rel=SAME), "the table's noise is no other"
    assert compared.is_adequate == (make is cautious_tracker)

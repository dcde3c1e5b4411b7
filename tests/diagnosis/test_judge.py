"""The clip made once more with its errors turned round, and what it says of a rival."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.diagnosis import judge
from galileo_jax.diagnosis.judge import expected_leads, turned_round
from tests.found import candidate_of, fit_of, make_trials


@pytest.fixture(scope="module")
def trials(tmp_path_factory):
    return make_trials(tmp_path_factory.mktemp("clip"))


def test_errors_are_turned_round(trials):
    """The fit stands in the middle between the clip and the clip turned round."""
    fit = fit_of(trials, ("air_drag",))
    turned = turned_round(trials, fit)
    theta = trials.of_clip(trials.theta(fit.z, fit.free), 0)
    (before,), (after,) = trials.problems, turned.problems
    seen = before.observation.mask[:, None] & np.ones((1, 2, 1), bool)
    middle = 0.5 * (before.observation.position_m + after.observation.position_m)
    np.testing.assert_allclose(middle[seen], before.simulate(theta)[seen], atol=1e-12)
    apart = before.observation.position_m - after.observation.position_m
    assert np.abs(apart[seen]).max() > 1e-3, "there are errors"


def test_luck_cancels_in_the_mean_of_both_clips(trials, monkeypatch):
    """In the clip the rival is 5 nats behind, turned round 9 (6 of evidence, 3 of the prior)."""
    evidence = {("air_drag",): 10.0, ("viscous_drag",): 4.0}

    def refit(turned, fit):
        assert turned is not trials
        (name,) = [n for n in evidence if (fit.free == trials.free(n)).all()]
        return replace(fit, log_evidence=evidence[name])

    monkeypatch.setattr(judge, "GradientFitter", lambda turned: turned)
    monkeypatch.setattr(judge, "refit", refit)
    best = replace(candidate_of(trials, "air_drag", 0.5), log_evidence=42.0, log_prior=-2.0)
    rival = replace(candidate_of(trials, "viscous_drag", 0.5), log_evidence=40.0, log_prior=-5.0)
    assert expected_leads(trials, best, [rival]) == [pytest.approx(0.5 * (5.0 + 9.0))]


def test_a_hypothesis_is_not_ahead_of_itself(trials):
    one = candidate_of(trials, "air_drag", 0.5)
    assert expected_leads(trials, one, [one]) == [0.0]


def test_where_there_is_no_rival_nothing_is_fitted(trials, monkeypatch):
    monkeypatch.setattr(judge, "GradientFitter", None)
    assert expected_leads(trials, candidate_of(trials, "air_drag", 0.5), []) == []

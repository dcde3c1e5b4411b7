"""What is said of the model without effects and of the noise, and how odds are told."""

from dataclasses import replace

import pytest

from galileo_jax.diagnosis.reasons import (
    decisive,
    p_equals,
    p_text,
    times_text,
    told_apart,
    without_effects,
)
from tests.diagnosis.test_verdict import candidate
from tests.found import comparison_of, make_trials


@pytest.fixture(scope="module")
def comparison(tmp_path_factory):
    return comparison_of(make_trials(tmp_path_factory.mktemp("clip")), 0.5)


@pytest.mark.parametrize(
    ("p_value", "rule"),
    [(0.01, "adequate_without_effects"), (0.0099, "contradicted_without_effects")],
)
def test_the_model_without_effects(comparison, p_value, rule):
    (why,) = without_effects(replace(comparison, p_value=p_value))
    assert why.rule == rule and f"p = {p_value}" in why.sentence
    assert why.numbers == {"p_value": p_value, "least_p_value": 0.01}


@pytest.mark.parametrize(
    ("scales", "p_value", "said"),
    [
        ((2.1,), 0.5, " 2.1 times "),
        ((1.51,), 0.5, " 1.5 times "),
        ((0.49,), 0.01, " 0.49 times "),
        ((1.0, 2.0), 0.5, " 1 to 2 times "),
        ((1.5,), 0.5, None),
        ((0.5,), 0.5, None),
        ((2.1,), 0.0099, None),  # what is left does not look like noise
    ],
)
def test_noise_of_another_size_is_told_of(comparison, scales, p_value, said):
    first, *rest = without_effects(replace(comparison, noise_scale=scales, p_value=p_value))
    assert (first.rule == "noise_misstated") is (said is not None)
    assert bool(rest) is (said is not None)
    if said is not None:
        assert said in first.sentence
        assert first.numbers["noise_scale_largest"] == max(scales)


def test_odds_and_p_values_in_words():
    assert times_text(3.0) == "20 times"
    assert times_text(4.87) == "130 times"
    assert times_text(-1.0) == "1/2.7"
    assert times_text(100.0) == "10^43 times"
    assert p_text(1e-30) == "< 1e-12" and p_equals(1e-30) == "p < 1e-12"
    assert p_equals(0.037) == "p = 0.037" and p_text(None) == ""


@pytest.mark.parametrize(
    ("prior", "said"), [(-5.0, " Before the data it was already 20 times as probable."), (-2.9, "")]
)
def test_a_lead_that_is_mostly_prior_is_said_to_be(prior, said):
    best, rival = candidate("air_drag", 40.0), candidate("a_form", 36.6, log_prior=prior)
    lead, expected = decisive(best, [rival], 3.0), told_apart(best, rival, 3.4, 3.0)
    assert f"30 times as probable as the next, a_form (20 times are needed).{said}" in lead.sentence
    assert lead.numbers["log_prior_behind"] == pytest.approx(-2.0 - prior)
    assert (
        f"30 times as probable as a_form after a clip like this one: enough to separate them.{said}"
        in expected.sentence
    )

"""Digits are shown where they mean something, and a mass where something depends on it."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from galileo_jax.results.shown import number, shown, shown_parameters


def test_numbers_have_the_places_their_uncertainty_allows():
    assert number(0.151812, 0.00036) == "0.15181"
    assert number(123.4, 17.0) == "123"
    assert number(None, 1.0) == "n/a"
    assert number(0.25, 0.0) == "0.25"


def test_what_rounds_to_zero_has_no_sign():
    assert number(-0.001, 0.2) == "0.00"


def test_a_digit_below_the_monte_carlo_error_is_not_shown():
    entry = {"mean": 0.151812, "sd": 0.00036, "mcse": {"mean": 1.1e-5, "sd": 0.9e-5}}
    assert shown(entry) == "0.1518"
    assert shown(entry, "sd") == "0.0004", "to the same place as the mean"
    assert number(123.4, 17.0, error=2.0) == "120"
    assert number(2.04, 0.2, error=0.15) == "2.0", "two ends of an interval are not one number"
    assert number(0.0478, 0.0478, error=0.0123) == "0.05", "an uncertainty is never 0"
    assert shown({"mean": 0.151812, "sd": 0.00036}) == "0.15181", "a run of an earlier version"


@given(st.floats(-1e4, 1e4), st.floats(1e-6, 1e3), st.floats(1e-3, 0.9))
def test_what_is_shown_is_the_number_to_a_digit_worth_more_than_its_error(value, sd, share):
    text = number(value, sd, share * sd)
    first = math.floor(math.log10(sd))
    bears = min(max(math.ceil(math.log10(share * sd)), first - 1), first)
    assert len(text.partition(".")[2]) == max(-bears, 0)
    assert float(text) == pytest.approx(value, abs=0.5001 * 10.0**bears)
    assert 10.0**bears >= share * sd * (1 - 1e-12) or bears == first


@pytest.mark.parametrize(
    ("parameters", "derived", "hidden"),
    [
        ({"m1": "kg", "k1": "1"}, {}, {"m1"}),
        ({"m1": "kg"}, {}, {"m1"}),
        ({"m1": "kg", "gravity": "m/s^2"}, {}, {"m1"}),
        ({"m1": "kg", "air_drag": "kg/m"}, {"air_drag_per_mass": "1/m"}, set()),
        ({"m1": "kg", "initial_push": "N s"}, {}, set()),
        ({"m1": "kg", "scale_error": "1"}, {}, {"m1"}),
        ({"m1": "kg", "period": "s"}, {"stiffness": "N/m", "stretch": "m"}, set()),
        ({"m1": "kg", "k1": "1", "m2": "kg", "k2": "1"}, {"mass_ratio": "1"}, set()),
    ],
)
def test_a_mass_that_acts_on_nothing_is_not_shown(parameters, derived, hidden):
    rooms = {"parameters": parameters, "derived": derived}
    result = {
        room: {name: {"unit": unit} for name, unit in units.items()}
        for room, units in rooms.items()
    }
    before = repr(result)
    shown = shown_parameters(result)
    assert list(shown) == [name for name in {**parameters, **derived} if name not in hidden]
    assert repr(result) == before

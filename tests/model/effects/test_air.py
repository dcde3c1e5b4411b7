"""The drag that is to be expected of the air, and what it makes of the odds."""

import math
from dataclasses import replace

import pytest

from galileo_jax.model.effects.air import (
    DRAG_COEFFICIENT,
    EXPECTED_ODDS,
    expected_drags,
    expected_odds,
)
from galileo_jax.model.effects.library.air_drag import FALL_PRIOR, AirDrag
from galileo_jax.model.effects.library.viscous_drag import ViscousDrag
from tests.model.effects.test_nuisances import INCLINE

TENNIS = replace(INCLINE, expected=expected_drags(0.033, 35.0, 9.81))


def test_a_ball_of_known_size_is_expected_to_feel_the_air():
    expected = 0.4 * 1.2 * math.pi * 0.033**2 / 2
    at_best = AirDrag().odds({"air_drag": expected}, TENNIS)
    assert TENNIS.expected["air_drag"] == (pytest.approx(expected), DRAG_COEFFICIENT[1])
    assert at_best > EXPECTED_ODDS["air_drag"]
    assert AirDrag().odds({"air_drag": 20 * expected}, TENNIS) == pytest.approx(1.0, abs=1e-3)
    # One in proportion to the speed is no more than possible: the air's is not.
    linear = ViscousDrag().odds({"viscous_drag": expected * 18.5}, TENNIS)
    assert 1.0 < linear < at_best / 20


def test_where_nothing_is_expected_the_odds_are_even():
    assert AirDrag().odds({"air_drag": 1e-3}, INCLINE) == 1.0
    assert expected_odds("air_drag", {"air_drag": 0.0}, TENNIS, FALL_PRIOR) == 1.0


def test_odds_make_the_prior_a_mixture():
    """Over the prior they are 1 of it and EXPECTED_ODDS of what is expected."""
    steps, mass = 4000, 0.0
    for i in range(steps):
        z = -8 + 16 * (i + 0.5) / steps
        density = math.exp(-0.5 * z**2) / math.sqrt(2 * math.pi) * 16 / steps
        strength = FALL_PRIOR.median * math.exp(FALL_PRIOR.sd * z)
        mass += density * AirDrag().odds({"air_drag": strength}, TENNIS)
    assert mass == pytest.approx(1.0 + EXPECTED_ODDS["air_drag"], rel=1e-3)

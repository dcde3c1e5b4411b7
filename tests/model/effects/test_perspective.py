"""What a pitched camera makes of a high fall, and when it is allowed for."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.assembly.expected import DISTANCE, EYE_M, pitched
from galileo_jax.model.effects.effect import FALL_LENGTH
from galileo_jax.model.effects.nuisances.perspective import Perspective
from galileo_jax.model.parameters import Normal
from tests.model.effects.test_nuisances import INCLINE

TOP_M, LENGTH_M = 40.0, 30.0
EXPECTED = {"perspective": (0.0, 0.2), FALL_LENGTH: (LENGTH_M, 0.0)}
SCENE = replace(INCLINE, start_m=((0.0, TOP_M),), expected=EXPECTED)


def seen(y: np.ndarray, growth: float) -> np.ndarray:
    place = np.stack([0 * y, y])[None]
    return np.asarray(Perspective().measure(place, {"perspective": growth}, SCENE)[0, 1])


@pytest.mark.parametrize(("height_m", "away_m"), [(1.6, 45.0), (40.0, 60.0)])
def test_it_is_what_a_pinhole_sees(height_m, away_m):
    """A camera aimed at the middle; the scale of its picture is set at both ends."""
    y = np.linspace(TOP_M, TOP_M - LENGTH_M, 31)
    pitch = np.arctan((TOP_M - LENGTH_M / 2 - height_m) / away_m)
    picture = np.tan(np.arctan((y - height_m) / away_m) - pitch)
    scaled = TOP_M + (picture - picture[0]) / (picture[0] - picture[-1]) * LENGTH_M
    # Distances along the axis of view, top against end, are what an end is magnified by.
    depth = away_m * np.cos(pitch) + (y - height_m) * np.sin(pitch)
    growth = np.log(depth[0] / depth[-1])
    assert abs(growth) > 0.1
    assert seen(y, growth) == pytest.approx(scaled, abs=1e-9)
    slope = abs(np.tan(pitch))
    first_order = slope * LENGTH_M / (away_m * (1 + slope**2))
    assert abs(growth) == pytest.approx(first_order, rel=0.1)


def test_without_growth_it_is_nothing_and_past_the_end_the_scale_stays():
    y = np.linspace(TOP_M, TOP_M - 2 * LENGTH_M, 41)
    assert (seen(y, 0.0) == y).all()
    steps = np.diff(seen(y, 0.4)[20:])
    assert steps == pytest.approx(steps[0] * np.ones(20))


def test_only_of_what_falls_from_high():
    assert Perspective().parameters(replace(SCENE, expected={})) == ()
    assert pitched(2 * EYE_M) == {}
    (parameter,) = Perspective().parameters(replace(SCENE, expected=pitched(35.0)))
    slope = (17.5 - EYE_M) / (DISTANCE * 35.0)
    assert parameter.role == "nuisance"
    assert isinstance(parameter.prior, Normal)
    assert parameter.prior.sd == pytest.approx(slope / (DISTANCE * (1 + slope**2)))

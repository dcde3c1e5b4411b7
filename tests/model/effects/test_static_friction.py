"""Static friction that shows: how late it makes the start, and what that makes of its odds."""

import math
from dataclasses import replace

import pytest
from scipy.integrate import quad
from scipy.stats import norm

from galileo_jax.model.effects.library.static_friction import (
    PRIOR,
    SEEN_DELAY_S,
    SLOW_M_S,
    StaticFriction,
)
from tests.model.effects.test_forms import PAIR
from tests.model.effects.test_nuisances import INCLINE

K1 = 0.15
MOST = math.tan(float(PAIR.angle_rad)) - K1  # with more the object never starts
PULL = PAIR.gravity * math.cos(float(PAIR.angle_rad))


def odds(extra: float, scene=PAIR) -> float:
    return StaticFriction().odds({"static_friction": extra, "k1": K1}, scene)


def delay_s(left: float) -> float:
    """By which an object sets off late that `left` of its friction's coefficient lets go."""
    extra, end = MOST - left, 10 * SLOW_M_S

    def held(speed: float) -> float:
        rest = MOST - extra * math.exp(-((speed / SLOW_M_S) ** 2))
        return 1 / (PULL * rest) - 1 / (PULL * MOST)

    return quad(held, 0.0, end, limit=200)[0]


def test_what_shows_starts_late():
    """The least of the band that is favoured delays by about what it says, by quadrature."""
    least = next(MOST - left for left in (i * 1e-5 for i in range(1, 99999)) if _even(left))
    assert 0.6 * SEEN_DELAY_S < delay_s(MOST - least) < SEEN_DELAY_S


def _even(left: float) -> bool:
    return odds(MOST - left) == 1.0


def test_the_prior_s_share_of_what_shows_is_no_evidence_against_it():
    inside = MOST - 1e-3
    left = next(left for left in (i * 1e-5 for i in range(1, 99999)) if _even(left))
    z = [math.log((MOST - x) / PRIOR.median) / PRIOR.sd for x in (0.0, left)]
    share = norm.cdf(z[0]) - norm.cdf(z[1])
    assert odds(inside) * share == pytest.approx(1.0, rel=0.01)
    assert odds(inside) > 10


@pytest.mark.parametrize(
    ("extra", "scene"),
    [
        (0.3 * MOST, PAIR),  # sets off at once
        (1.1 * MOST, PAIR),  # never does
        (MOST - 1e-3, replace(PAIR, comes_down=(False, False))),
        (MOST - 1e-3, replace(PAIR, has_surface=False)),
    ],
)
def test_where_it_does_not_start_late_the_odds_are_even(extra, scene):
    assert odds(extra, scene) == 1.0


def test_on_a_board_alone_it_is_the_same():
    steep = math.tan(float(INCLINE.angle_rad)) - K1
    assert odds(steep - 1e-4, INCLINE) > 10

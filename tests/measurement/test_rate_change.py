"""Films that go over to slow motion, as phones make them: where, and by how much."""

import numpy as np
import pytest

from galileo_jax.measurement.segments.rate_change import rate_change
from tests.measurement.seen import seen

SLIDES = 2.3 * np.array([0.906, -0.423])  # m/s^2, down a board
REST = 8  # pictures


def filmed(moving: int, factor: float) -> tuple[np.ndarray, np.ndarray]:
    """Times as they are played, 30 a second, and places: so many pictures move at the true rate."""
    played = np.arange(REST + moving + 60) / 30
    change_s = (REST + moving - 0.5) / 30
    true = np.where(played < change_s, played, change_s + (played - change_s) * factor)
    since = np.maximum(true - (REST - 0.3) / 30, 0.0)
    return played, np.outer(SLIDES, since**2 / 2)


@pytest.mark.parametrize("moving", [4, 6, 20])
@pytest.mark.parametrize("factor", [1 / 4, 1 / 8])
def test_what_has_just_been_let_go_shows_it_too(moving: int, factor: float) -> None:
    times, place = filmed(moving, factor)
    found = rate_change(seen(place, times, 1e-4, seed=1))
    assert found is not None
    assert abs(found[0] - (REST + moving - 1)) <= 1
    assert found[1] == pytest.approx(factor, rel=0.15)


@pytest.mark.parametrize("left", [0.1, 0.5, 0.8])
def test_a_blow_after_the_release_is_none(left: float) -> None:
    """It takes speed, and leaves the acceleration as it is."""
    times = np.arange(60) / 30
    since = np.maximum(times - (REST - 0.3) / 30, 0.0)
    hit_s = 6 / 30
    after = np.maximum(since - hit_s, 0.0)
    way = since**2 / 2 - (1 - left) * hit_s * after
    assert rate_change(seen(np.outer(SLIDES, way), times, 1e-4, seed=1)) is None

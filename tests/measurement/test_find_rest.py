"""Where a clip of pucks ends: a while after everything has come to rest."""

import numpy as np
import pytest

from galileo_jax.measurement.segments.rest import REST_S, rest_frame
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

FPS, RADIUS_M, COUNT = 100.0, 0.02, 300


def pucks(*paths: np.ndarray, gone_after: int = COUNT) -> Observation:
    """Pucks along x; the last of them leaves the picture after a frame."""
    noise = 2e-4 * np.random.default_rng(4).standard_normal(COUNT)
    found = seen(np.array([[path, noise] for path in paths]), np.arange(COUNT) / FPS, 2e-4)
    return found.without(slice(gone_after + 1, None), len(paths) - 1)


TIME = np.arange(COUNT) / FPS
STOPS = np.minimum(TIME, 0.5) * 0.4  # at rest from 0.5 s on
DRIFT = 5e-4 * np.clip(TIME - 1.5, 0, 0.5)  # of a camera that gives way


def test_it_ends_after_the_last_stop_whatever_the_camera_does() -> None:
    last = rest_frame(pucks(STOPS + DRIFT), RADIUS_M)
    assert last is not None
    assert TIME[last] == pytest.approx(0.5 + REST_S, abs=0.02)


def test_who_leaves_the_picture_moves_until_then() -> None:
    last = rest_frame(pucks(STOPS, 0.5 * TIME, gone_after=120), RADIUS_M)
    assert last is not None
    assert TIME[last] == pytest.approx(1.2 + REST_S, abs=0.03)


def test_what_moves_to_the_end_is_not_cut() -> None:
    assert rest_frame(pucks(STOPS, 0.3 * TIME), RADIUS_M) is None

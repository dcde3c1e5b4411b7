"""Where a clip of pucks ends: a while after everything has come to rest."""

import numpy as np
import pytest

from galileo_jax.measurement.segments.rest import REST_S, rest_frame
from galileo_jax.observation.observation import Observation

FPS, RADIUS_M, COUNT = 100.0, 0.02, 300


def seen(*paths: np.ndarray, gone_after: int | None = None) -> Observation:
    """Pucks along x; the last of them leaves the picture after a frame."""
    place = np.zeros((len(paths), 2, COUNT))
    place[:, 0] = paths
    mask = np.ones((len(paths), COUNT), bool)
    if gone_after is not None:
        mask[-1, gone_after + 1 :] = False
    place[:, 1] += 2e-4 * np.random.default_rng(4).standard_normal(COUNT)
    covariance = np.broadcast_to(4e-8 * np.eye(2)[None, :, :, None], (len(paths), 2, 2, COUNT))
    names = tuple(f"object{i + 1}" for i in range(len(paths)))
    return Observation(names, np.arange(COUNT) / FPS, place, covariance, mask)


TIME = np.arange(COUNT) / FPS
STOPS = np.minimum(TIME, 0.5) * 0.4  # at rest from 0.5 s on
DRIFT = 5e-4 * np.clip(TIME - 1.5, 0, 0.5)  # of a camera that gives way


def test_it_ends_after_the_last_stop_whatever_the_camera_does() -> None:
    last = rest_frame(seen(STOPS + DRIFT), RADIUS_M)
    assert last is not None
    assert TIME[last] == pytest.approx(0.5 + REST_S, abs=0.02)


def test_who_leaves_the_picture_moves_until_then() -> None:
    last = rest_frame(seen(STOPS, 0.5 * TIME, gone_after=120), RADIUS_M)
    assert last is not None
    assert TIME[last] == pytest.approx(1.2 + REST_S, abs=0.03)


def test_what_moves_to_the_end_is_not_cut() -> None:
    assert rest_frame(seen(STOPS, 0.3 * TIME), RADIUS_M) is None

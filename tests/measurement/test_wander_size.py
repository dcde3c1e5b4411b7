"""How far camera and tracker wander, from the track alone."""

import numpy as np
import pytest

from galileo_jax.measurement.wander_size import LARGEST_M, LASTS_S, with_wander
from galileo_jax.observation.observation import Observation

SD_M = 1e-5


def pucks(wander_m: float, seed: int, frames: int = 70, fps: float = 60.0) -> Observation:
    """A puck that slides and hits another, with errors and wander."""
    rng = np.random.default_rng(seed)
    times = np.arange(frames) / fps
    hit = times[min(15, frames - 1)]
    before, since = np.minimum(times, hit), np.maximum(times - hit, 0)
    slid = 1.5 * before - before**2
    gone = np.where(since < 0.5, 0.8 * since - 0.8 * since**2, 0.2)
    place = np.zeros((2, 2, frames))
    place[0, 0] = slid + 0.3 * gone
    place[1, 0] = slid[-1] + 0.04 + gone
    apart = np.abs(times[:, None] - times)
    root = np.linalg.cholesky(np.exp(-apart / LASTS_S) + 1e-12 * np.eye(frames))
    place += wander_m * (rng.standard_normal(place.shape) @ root.T)
    place += SD_M * rng.standard_normal(place.shape)
    covariance = np.broadcast_to(SD_M**2 * np.eye(2)[None, :, :, None], (2, 2, 2, frames))
    mask = np.ones((2, frames), bool)
    return Observation(("one", "other"), times, place, covariance, mask)


@pytest.mark.parametrize("wander_m", [3e-5, 2e-4])
def test_the_wander_is_found(wander_m: float) -> None:
    found = [with_wander(pucks(wander_m, seed)).wander_m or 0.0 for seed in range(4)]
    assert np.mean(found) == pytest.approx(wander_m, rel=0.3)


def test_what_does_not_wander_is_said_to_be_still() -> None:
    found = with_wander(pucks(0.0, 9)).wander_m
    assert found is not None
    assert found < SD_M


def test_a_track_that_is_too_short_tells_nothing() -> None:
    assert with_wander(pucks(0.0, 9, frames=5)).wander_m == LARGEST_M

"""Rests: which motion between them is the run that is meant, and when everything has ended."""

import numpy as np
import pytest

from galileo_jax.measurement.segments.rest import REST_S, placed_frames, rest_frame
from galileo_jax.observation.observation import Observation
from tests.measurement.seen import seen

NOISE_M, SLOPE = 3e-4, 0.4
DOWN = np.array([np.cos(SLOPE), -np.sin(SLOPE)])
CARRY, REST, SLIDE = 0.6, 0.7, 1.0  # s


def down(way_m: np.ndarray, fps: float) -> Observation:
    """An object so far down a board, `[frame]`."""
    return seen(way_m * DOWN[:, None], np.arange(len(way_m)) / fps, NOISE_M, seed=3)


def smooth(since: np.ndarray) -> np.ndarray:
    """From 0 to 1 as a hand moves."""
    u = np.clip(since / CARRY, 0.0, 1.0)
    return u**3 * (10 - 15 * u + 6 * u**2)


def slid(since: np.ndarray, length_m: float = 0.6) -> np.ndarray:
    return np.clip(since, 0.0, SLIDE) ** 2 * length_m / SLIDE**2


@pytest.mark.parametrize("fps", [30.0, 60.0, 240.0])
@pytest.mark.parametrize("from_m", [0.3, -0.3], ids=["from below", "from above"])
def test_what_puts_it_into_place_is_no_part_of_the_run(fps, from_m):
    t = np.arange(0, CARRY + REST + SLIDE, 1 / fps)
    first, last = placed_frames(down(from_m * (1 - smooth(t)) + slid(t - CARRY - REST), fps))
    assert last is None and first is not None
    assert CARRY < t[first] < CARRY + REST


@pytest.mark.parametrize("fps", [30.0, 240.0])
def test_nor_is_what_takes_it_away(fps):
    t = np.arange(0, REST + SLIDE + REST + CARRY, 1 / fps)
    way = slid(t - REST) - 0.5 * smooth(t - REST - SLIDE - REST)
    first, last = placed_frames(down(way, fps))
    assert first is None and last is not None
    assert REST + SLIDE < t[last] < 2 * REST + SLIDE


def test_a_camera_that_runs_long_and_a_long_rest_at_the_end_are_no_hands():
    t = np.arange(0, 6.0, 1 / 60)
    assert placed_frames(down(slid(t - 3.0), 60.0)) == (None, None)


def test_what_turns_back_slowly_does_not_rest():
    """A disc in a valley stands still at either end, for an instant."""
    t = np.arange(0, 8.0, 1 / 120)
    assert placed_frames(down(0.4 * (1 - np.cos(1.2 * t)), 120.0)) == (None, None)


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

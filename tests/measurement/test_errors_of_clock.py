"""Times of a flight that come late and catch up are found along its path, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.measurement.errors_of_clock import with_errors_of_clock
from galileo_jax.observation.observation import Observation

ROWS, STEP_S, SD_M, SD_S = 50, 0.007, 1e-3, 5e-4
SPEED_M_S, DRAG_S, GRAVITY = 9.0, 0.8, 9.81
STALL_S = 0.005  # soon made up for


def flight(seed: int, late_s: np.ndarray | float = 0.0, bend: float = 0.0) -> Observation:
    """A ball that air slows down; every time is half a millisecond off, and `late_s` late."""
    rng = np.random.default_rng(seed)
    times = np.arange(ROWS) * STEP_S
    told = times + late_s + SD_S * rng.standard_normal(ROWS)
    way = SPEED_M_S * DRAG_S * (1 - np.exp(-times / DRAG_S))
    path = np.stack([way, 1.0 * times - GRAVITY / 2 * times**2, bend * way**2])
    places = path + SD_M * rng.standard_normal((3, ROWS))
    velocity = np.gradient(path, times, axis=1)
    way_there = velocity / np.linalg.norm(velocity, axis=0)
    along2 = (SD_S * np.linalg.norm(velocity, axis=0)) ** 2
    cover = SD_M**2 * np.eye(3)[..., None] + along2 * way_there[:, None] * way_there[None]
    return Observation(("ball",), told, places[None], cover[None], np.ones((1, ROWS), bool))


def stalls() -> np.ndarray:
    """At a third of the flight a picture is told late, and the next ones less and less so."""
    since = np.arange(ROWS) - ROWS // 3
    return np.where(since >= 0, STALL_S * np.exp(-np.maximum(since, 0) / 5), 0.0)


@pytest.mark.parametrize("bend", [0.0, 0.05])
def test_times_that_scatter_are_left_as_they_are(bend: float) -> None:
    found = [with_errors_of_clock(flight(seed, bend=bend)) for seed in range(30)]
    assert sum(bool(said) for _, said in found) <= 1
    seen = flight(0)
    assert with_errors_of_clock(seen)[0] is seen


def test_times_that_are_late_and_catch_up_are_found() -> None:
    found = [with_errors_of_clock(flight(seed, stalls())) for seed in range(8)]
    assert all(said for _, said in found)
    for seen, (line,) in found:
        assert seen.modes_m is not None and seen.num_errors == len(seen.modes_m)
        assert line.startswith("ball: its times are off by ")
        late_ms = float(line.split(" by ")[1].split()[0])
        assert 0.3 < late_ms < 3.0
        # All of it is along the path.
        velocity = np.gradient(seen.position_m[0], seen.times_s, axis=1)[:, ROWS // 2]
        direction = velocity / np.linalg.norm(velocity)
        middle = seen.modes_m[:, 0, :, ROWS // 2]
        along = middle @ direction
        assert np.sum(middle**2) == pytest.approx(np.sum(along**2), rel=0.05)
        assert np.all(np.linalg.eigvalsh(np.moveaxis(seen.covariance_m2[0], -1, 0)) > 0)


def test_rows_that_are_missing_stay_so() -> None:
    seen = flight(3, stalls())
    mask = seen.mask.copy()
    mask[0, [4, 20, 21]] = False
    gaps = replace(seen, mask=mask, position_m=np.where(mask[:, None], seen.position_m, np.nan))
    found, said = with_errors_of_clock(gaps)
    assert said and found.modes_m is not None
    assert np.all(found.modes_m[:, 0, :, ~mask[0]] == 0)
    assert np.isfinite(found.modes_m).all()


def test_few_rows_tell_nothing() -> None:
    seen = flight(0, stalls())
    mask = np.zeros_like(seen.mask)
    mask[0, :5] = True
    few = replace(seen, mask=mask)
    assert with_errors_of_clock(few) == (few, [])

"""Errors that follow each other are found in a track, and nothing else is taken for them."""

import numpy as np
import pytest

from galileo_jax.measurement.errors_in_time import with_errors_in_time
from galileo_jax.observation.observation import Observation

ROWS, STEP_S, SD_M = 60, 1 / 15, 0.06
TIMES = np.arange(ROWS) * STEP_S
SEEDS = range(8)


def _track(path: np.ndarray, error: np.ndarray) -> Observation:
    position = np.stack([0.0 * TIMES, path + SD_M * error])[None]
    covariance = np.repeat(SD_M**2 * np.eye(2)[None, :, :, None], ROWS, axis=3)
    return Observation(("ball",), TIMES, position, covariance, np.ones((1, ROWS), bool))


def _errors(seed: int, correlation: float) -> np.ndarray:
    apart = np.abs(np.subtract.outer(np.arange(ROWS), np.arange(ROWS)))
    cover = correlation**apart if correlation else np.eye(ROWS)
    return np.linalg.cholesky(cover) @ np.random.default_rng(seed).standard_normal(ROWS)


def _found(path: np.ndarray, correlation: float) -> list[Observation]:
    return [with_errors_in_time(_track(path, _errors(s, correlation)))[0] for s in SEEDS]


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(-4.905 * TIMES**2, id="fall"),
        pytest.param(3.0 * np.sin(2 * np.pi * TIMES), id="15 rows a period"),
        pytest.param(3.0 * np.abs(TIMES - 2.0), id="struck once"),
        pytest.param(1.0 - np.exp(-TIMES / 0.2), id="soon at its final speed"),
    ],
)
def test_independent_errors_are_left_as_stated(path: np.ndarray):
    assert not any(one.num_errors for one in _found(path, 0.0))


def test_errors_that_follow_each_other_are_found_in_their_size():
    """In most tracks of 60 rows; whose shared part is most of the variance, which is as drawn."""
    found = [one for one in _found(-4.905 * TIMES**2, 0.8) if one.num_errors]
    assert len(found) >= 6
    alone = np.array([one.covariance_m2[0, 1, 1, 0] for one in found])
    modes = [one.modes_m for one in found if one.modes_m is not None]
    shared = np.array([np.sum(own[:, 0, 1, ROWS // 2] ** 2) for own in modes])
    assert np.all(shared > alone)
    assert 0.5 < np.sqrt(np.median(alone + shared)) / SD_M < 1.3
    assert all(one.covariance_m2[0, 0, 0, 0] == SD_M**2 for one in found), "x shows none"


def test_what_was_found_is_said():
    seen, said = with_errors_in_time(_track(-4.905 * TIMES**2, _errors(1, 0.8)))
    assert seen.modes_m is not None and seen.num_errors == len(seen.modes_m)
    assert len(said) == 1 and said[0].startswith("ball: errors in y are correlated in time: ")

"""What stands still is given the noise that it has; what moves keeps what is stated."""

import numpy as np
import pytest

from galileo_jax.measurement.noise_at_rest import LEAST_SCALE, with_noise_at_rest
from galileo_jax.observation.observation import Observation

FRAMES, SD_M = 120, 1e-4


def filmed(noise_at_rest, seed=81):
    """At rest for 60 frames, then moving, with noise of which only that in motion is as stated."""
    rng, times = np.random.default_rng(seed), np.arange(FRAMES) / 60
    is_moving = times >= 1.0
    x = 0.3 + np.where(is_moving, 0.4 * (times - 1.0), 0.0)
    stated = SD_M * (1 + 0.5 * (np.arange(FRAMES) % 2))  # from frame to frame another
    sd = stated * np.where(is_moving, 1.0, noise_at_rest)
    position = np.stack([x, 0 * x])[None] + sd * rng.standard_normal((1, 2, FRAMES))
    covariance = stated**2 * np.tile(np.eye(2)[None, ..., None], (1, 1, 1, FRAMES))
    return Observation(("object1",), times, position, covariance, np.ones((1, FRAMES), bool))


def scales(observation):
    before, after = observation.covariance_m2, with_noise_at_rest(observation).covariance_m2
    assert (after[:, 0, 1] == 0).all()
    return np.sqrt(after[0, 0, 0] / before[0, 0, 0])


@pytest.mark.parametrize("noise", [0.5, 0.8])
def test_noise_at_rest_is_found(noise):
    found = scales(filmed(noise))
    assert (found[70:] == 1.0).all(), "in motion nothing changes"
    assert found[:55] == pytest.approx(noise, rel=0.15)


def test_it_is_never_raised_and_not_lowered_without_end():
    assert (scales(filmed(1.5)) == 1.0).all()
    assert scales(filmed(0.01))[:55] == pytest.approx(LEAST_SCALE)


def test_a_short_track_is_left_as_it_is():
    whole = filmed(0.5)
    short = Observation(
        whole.names,
        whole.times_s[:8],
        whole.position_m[..., :8],
        whole.covariance_m2[..., :8],
        whole.mask[:, :8],
    )
    assert with_noise_at_rest(short) is short


def test_the_shift_of_what_came_to_rest_is_one_error():
    """Of a coder: as large as the errors in motion, however many frames of the rest there are."""
    seen = filmed(0.4)
    back = Observation(
        seen.names,
        seen.times_s,
        seen.position_m[..., ::-1],
        seen.covariance_m2[..., ::-1],
        seen.mask,
    )
    found = with_noise_at_rest(back)
    assert found.modes_m is not None and found.modes_m.shape == (2, 1, 2, FRAMES)
    assert not found.modes_m[..., :55].any(), "nothing is shared by what moves"
    for axis, mode in enumerate(found.modes_m):
        assert not mode[0, 1 - axis].any()
        at_rest = mode[0, axis, 75:]
        assert (at_rest == at_rest[0]).all()
        moving, resting = (
            found.covariance_m2[0, axis, axis, part] for part in (slice(55), slice(75, None))
        )
        assert at_rest[0] ** 2 + np.median(resting) == pytest.approx(np.median(moving), rel=0.1)
    assert with_noise_at_rest(seen).modes_m is None, "the first picture is coded by itself"

"""What stands still is given the noise that it has; what moves keeps what is stated."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.measurement.errors_at_rest import (
    LEAST_SCALE,
    MOST,
    WINDOW,
    with_errors_at_rest,
)
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
    found = with_errors_at_rest(observation)
    assert (found.covariance_m2[:, 0, 1] == 0).all()
    variance = np.diag(covariance_of(found, 0)) * SD_M**2
    return np.sqrt(variance / observation.covariance_m2[0, 0, 0])


@pytest.mark.parametrize("noise", [0.5, 0.8])
def test_noise_at_rest_is_found(noise):
    found = scales(filmed(noise))
    assert (found[70:] == 1.0).all(), "in motion nothing changes"
    assert found[:55] == pytest.approx(noise, rel=0.2)


def test_it_is_not_lowered_without_end():
    assert scales(filmed(0.01))[:55] == pytest.approx(LEAST_SCALE, rel=0.1)


def test_what_comes_to_rest_is_not_yet_at_rest():
    """A coder that leaves a picture as it is shows it where it was: seen late by half its noise."""
    times = np.arange(FRAMES) / 60
    left_s = np.maximum(1.0 - times, 0.0)
    path = np.stack([0.3 - 0.2 * left_s**2, 0 * times])[None]  # slows down to a stop
    sd = SD_M * np.where(times < 1.0, 1.0, 0.4)
    noise = sd * np.random.default_rng(3).standard_normal((1, 2, FRAMES))
    found = scales(replace(filmed(0.4), position_m=path + noise))
    assert (found[:65] == 1.0).all(), "five frames more"
    assert (found[75:] < 0.8).all()


def test_a_slow_even_motion_is_no_rest():
    """No step of it stands out, as one does where a picture is coded anew."""
    whole = filmed(1.0)
    sd = np.sqrt(whole.covariance_m2[0, 0, 0])
    path = np.stack([1.4 * SD_M * 1.5 * np.arange(FRAMES), np.zeros(FRAMES)])[None]
    noise = 0.1 * sd * np.random.default_rng(5).standard_normal((1, 2, FRAMES))
    assert (scales(replace(whole, position_m=path + noise)) == 1.0).all()


def test_a_short_track_is_left_as_it_is():
    whole = filmed(0.5)
    short = Observation(
        whole.names,
        whole.times_s[:8],
        whole.position_m[..., :8],
        whole.covariance_m2[..., :8],
        whole.mask[:, :8],
    )
    assert with_errors_at_rest(short) is short


def test_the_shift_of_what_came_to_rest_is_one_error():
    """Of a coder: a share of the errors in motion, however many frames of the rest there are."""
    seen = filmed(0.4)
    back = Observation(
        seen.names,
        seen.times_s,
        seen.position_m[..., ::-1],
        seen.covariance_m2[..., ::-1],
        seen.mask,
    )
    found = with_errors_at_rest(back)
    assert found.modes_m is not None
    assert not found.modes_m[..., :55].any(), "nothing is shared by what moves"
    shifts = found.modes_m[: len(found.modes_m) - found.num_errors]
    assert shifts.shape == (2, 1, 2, FRAMES)
    for axis, mode in enumerate(shifts):
        assert not mode[0, 1 - axis].any()
        at_rest = mode[0, axis, 75:]
        assert (at_rest == at_rest[0]).all()
        # Of the same frames: what is stated has two sizes, and a median may be either.
        moving, resting = (
            np.median(np.diag(covariance_of(found, axis))[part]) * SD_M**2
            for part in (mode[0, axis] == 0, mode[0, axis] != 0)
        )
        assert at_rest[0] ** 2 == pytest.approx(0.4 * (moving - resting), rel=0.35)
    first = with_errors_at_rest(seen)
    shifts = 0 if first.modes_m is None else len(first.modes_m) - first.num_errors
    assert shifts == 0, "the first picture is coded by itself"


def at_rest_all_the_time(memory, seed, frames=60):
    """A body that nothing moves, whose errors `[1, 2, frame]` are as `memory` of those before."""
    rng, errors = np.random.default_rng(seed), np.zeros((1, 2, frames))
    fresh = rng.standard_normal(errors.shape)
    for j in range(frames):
        before = errors[..., j - 1] if j else fresh[..., 0]
        errors[..., j] = memory * before + np.sqrt(1 - memory**2) * fresh[..., j]
    covariance = SD_M**2 * np.tile(np.eye(2)[None, ..., None], (1, 1, 1, frames))
    times, mask = np.arange(frames) / 30, np.ones((1, frames), bool)
    return Observation(("object1",), times, 0.2 + SD_M * errors, covariance, mask)


def covariance_of(observation, axis):
    """`[frame, frame]`, in units of what was stated."""
    found = np.diag(observation.covariance_m2[0, axis, axis])
    if observation.num_errors:
        own = observation.modes_m[-observation.num_errors :, 0, axis]
        found = found + own.T @ own
    return found / SD_M**2


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.65])
def test_errors_that_follow_each_other_are_told_from_independent_ones(memory):
    """The mean of a rest is as uncertain as it is, and whitened errors are independent."""
    of_mean, lags, squares = [], [], []
    for seed in range(30):
        seen = with_errors_at_rest(at_rest_all_the_time(memory, seed))
        for axis in range(2):
            cover = covariance_of(seen, axis)
            of_mean.append(cover.mean())
            errors = (seen.position_m[0, axis] - 0.2) / SD_M
            white = np.linalg.solve(np.linalg.cholesky(cover), errors)
            lags.append(np.mean(white[1:] * white[:-1]))
            squares.append(np.mean(white**2))
    apart = np.abs(np.subtract.outer(np.arange(60), np.arange(60)))
    true = np.mean(float(memory) ** apart) if memory else 1 / 60
    # A rest that scatters less than the others by chance is taken to scatter as they do.
    assert 0.7 < np.median(of_mean) / true < 1.8
    assert np.mean(lags) == pytest.approx(0.0, abs=0.1)
    assert 0.75 < np.mean(squares) < 1.1


def test_a_slow_start_is_no_error_of_the_rest():
    """Frames beside a motion are not learnt from."""
    seen = at_rest_all_the_time(0.0, 5)
    moved = seen.position_m.copy()
    moved[0, 0, -4:] += SD_M * np.array([2.0, 8.0, 20.0, 40.0])
    starts = Observation(seen.names, seen.times_s, moved, seen.covariance_m2, seen.mask)
    without, found = (covariance_of(with_errors_at_rest(one), 0) for one in (seen, starts))
    assert np.median(np.diag(found)[:50]) == pytest.approx(
        np.median(np.diag(without)[:50]), rel=0.2
    )


REPEATED_SD_M, CODED_EVERY = SD_M / 20, 12  # stated of a frozen picture; frames


def frozen(seed, jump_m=0.0, frames=120):
    """A body at rest that a coder repeats, and now and then codes anew, with errors of SD_M.

    Half way it goes so far besides.
    """
    rng, still = np.random.default_rng(seed), at_rest_all_the_time(0.0, seed, frames)
    coded = SD_M / 2 * rng.standard_normal((1, 2, frames // CODED_EVERY))
    errors = np.repeat(coded, CODED_EVERY, axis=-1)
    errors += 0.1 * REPEATED_SD_M * rng.standard_normal((1, 2, frames))
    gone = np.where(np.arange(frames) < frames // 2, 0.0, jump_m)
    covariance = still.covariance_m2 * (REPEATED_SD_M / SD_M) ** 2
    return replace(still, position_m=0.2 + errors + gone, covariance_m2=covariance)


def test_what_is_coded_anew_is_off_anew():
    """However small the error that is stated of a picture that is repeated."""
    off, squares, alike, least = [], [], [], 0.99 * (LEAST_SCALE * REPEATED_SD_M / SD_M) ** 2
    for seed in range(20):
        seen = with_errors_at_rest(frozen(seed))
        for axis in range(2):
            cover = covariance_of(seen, axis)
            errors = (seen.position_m[0, axis] - 0.2) / SD_M
            assert np.linalg.eigvalsh(cover)[0] > least, (
                "no frame is better known by its neighbours"
            )
            off.append(errors.mean() / np.sqrt(cover.mean()))
            white = np.linalg.solve(np.linalg.cholesky(cover), errors)
            squares.append(np.mean(white**2))
            alike.append(np.mean(white[1:] * white[:-1]))
    assert 0.6 < np.sqrt(np.mean(np.square(off))) < 1.2
    assert 0.7 < np.mean(squares) < 1.1
    assert np.mean(alike) == pytest.approx(0.0, abs=0.2)


def test_what_moves_within_a_frame_has_moved():
    """By more than a picture that is coded anew is off: that is no error, however quick it was."""
    cover = covariance_of(with_errors_at_rest(frozen(3, jump_m=50 * SD_M)), 0)
    assert np.sqrt(np.diag(cover).max()) < 2


def test_what_is_far_from_motion_is_left_out_of_a_long_rest():
    """Minutes of a film before its motion: their covariance would fill the memory."""
    short = filmed(0.5)
    rng, more = np.random.default_rng(5), 2000
    start = short.position_m[..., :1] + 0.5 * SD_M * rng.standard_normal((1, 2, more))
    whole = replace(
        short,
        times_s=np.arange(more + FRAMES) / 60,
        position_m=np.concatenate([start, short.position_m], axis=-1),
        covariance_m2=np.concatenate(
            [np.tile(SD_M**2 * np.eye(2)[None, ..., None], (1, 1, 1, more)), short.covariance_m2],
            axis=-1,
        ),
        mask=np.ones((1, more + FRAMES), bool),
    )
    found = with_errors_at_rest(whole)
    assert MOST <= found.mask[0, :-60].sum() < MOST + 2 * WINDOW
    assert found.mask[0, -60 - MOST // 2 :].all(), "the last of it, and all of the motion"

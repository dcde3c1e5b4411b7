import numpy as np
import pytest

from galileo_jax.tracking.motion_compensation import (
    STEPS_PER_PX,
    VARIES_PX,
    Coding,
    coding_shift_amplitudes_px,
    without_coding_shift,
)

NOISE_PX, FRAMES = 0.01, 90
STILL = np.zeros(1)
TIME = np.arange(float(FRAMES))
ACCELERATED = np.stack([0.7 * TIME + 0.031 * TIME**2, 0.3 * TIME + 0.012 * TIME**2], axis=1)


def seen(path, amplitudes, is_predicted, rng):
    """The path as a coder shows it: e of the displacement from what the frame before showed."""
    shown = path + NOISE_PX * rng.standard_normal(path.shape)
    for t in range(1, len(path)):
        if is_predicted[t]:
            true, before = shown[t].copy(), shown[t - 1]
            for _ in range(50):  # e depends on where the object is shown
                phase = 2 * np.pi * STEPS_PER_PX * (shown[t] - before)[:, None]
                shown[t] = true + np.sin(phase) @ amplitudes
    return shown, np.tile(0.005**2 * np.eye(2), (len(path), 1, 1))


def mended_places(paths, coding, angle_rad=STILL):
    poses = [
        (np.column_stack([place, np.broadcast_to(angle_rad, len(place))]), noise)
        for place, noise in paths
    ]
    return [
        found.poses[:, :2]
        for found in without_coding_shift(poses, coding, np.arange(float(len(poses[0][0]))))
    ]


def coded(frames=FRAMES, whole=12):
    return np.arange(frames) % whole != 0


CODING = Coding(coded())
CLOCK = np.arange(float(FRAMES))


@pytest.mark.parametrize(
    "amplitudes",
    [(0.0, -0.03, 0.0), (0.0, 0.0, -0.02), (-0.006, -0.02, -0.01), (0.0, 0.0, 0.0)],
)
def test_amplitudes_of_a_coder_are_found(amplitudes):
    rng = np.random.default_rng(1)
    found = [
        coding_shift_amplitudes_px(
            [seen(path, np.array(amplitudes), coded(), rng) for path in both],
            coded(),
            CLOCK,
        )
        for both in [(ACCELERATED, 1.1 * ACCELERATED)] * 20
    ]
    found = np.reshape(found, (-1, len(STEPS_PER_PX)))  # each object's along each axis
    np.testing.assert_allclose(np.mean(found, axis=0), amplitudes, atol=0.003)
    np.testing.assert_allclose(np.std(found, axis=0), 0.0, atol=0.004)


def test_objects_have_amplitudes_of_their_own():
    rng = np.random.default_rng(7)
    each = [np.array([0.0, half, 0.0]) for half in (-0.02, -0.035)]
    found = []
    for _ in range(20):
        paths = [seen(ACCELERATED, own, coded(), rng) for own in each]
        found.append(coding_shift_amplitudes_px(paths, coded(), CLOCK)[..., 1].mean(axis=1))
    one, other = np.mean(found, axis=0)  # each drawn a little to what both have
    assert -0.026 < one < -0.019
    assert -0.036 < other < -0.029


def test_of_an_object_that_hardly_moves_the_video_tells_the_amplitudes():
    rng = np.random.default_rng(8)
    moving = seen(ACCELERATED, np.array([0.0, -0.03, 0.0]), coded(), rng)
    resting = (np.tile([30.0, 40.0], (FRAMES, 1)), moving[1])
    alone, beside = coding_shift_amplitudes_px([moving, resting], coded(), CLOCK)
    np.testing.assert_array_equal(beside[0], beside[1])
    assert abs(beside[0, 1] - alone[0, 1]) < 0.01


def test_places_are_nearer_to_the_truth_and_their_errors_independent():
    rng = np.random.default_rng(2)
    before, after, neighbours = 0.0, 0.0, 0.0
    for _ in range(20):
        place, noise = seen(ACCELERATED, np.array([0.0, -0.03, 0.0]), coded(), rng)
        (mended,) = mended_places([(place, noise)], CODING)
        wrong, left = place - ACCELERATED, mended - ACCELERATED
        before, after = before + np.sum(wrong**2), after + np.sum(left**2)
        neighbours += np.sum(left[1:] * left[:-1])
    assert np.sqrt(after / before) < 0.6  # noise alone: 0.42
    assert abs(neighbours / after) < 0.1


def test_whole_frames_and_what_rests_stay():
    rng = np.random.default_rng(3)
    place, noise = seen(ACCELERATED, np.array([0.0, -0.03, 0.0]), coded(), rng)
    (mended,) = mended_places([(place, noise)], CODING)
    np.testing.assert_array_equal(mended[::12], place[::12])
    resting = np.tile([30.0, 40.0], (FRAMES, 1))
    (alone,) = mended_places([(resting, noise)], CODING)
    np.testing.assert_array_equal(alone, resting)


def test_what_stays_uncertain_is_a_share_of_what_is_taken_off():
    rng = np.random.default_rng(9)
    place, noise = seen(ACCELERATED, np.array([0.0, -0.03, 0.0]), coded(), rng)
    poses = np.column_stack([place, np.zeros(FRAMES)])
    (found,) = without_coding_shift([(poses, noise)], CODING, CLOCK)
    assert found.shifts_px.shape == (FRAMES, 2 * len(STEPS_PER_PX), 2)
    sizes = np.abs(found.shifts_px).max(axis=(0, 2)).reshape(-1, 2)
    assert sizes.max() <= VARIES_PX
    assert (sizes[1] > 0.9 * VARIES_PX).all(), "half pixels, along either axis"
    assert not found.shifts_px[::12].any(), "whole frames show what is there"
    (plain,) = without_coding_shift([(poses, noise)], Coding(np.zeros(FRAMES, bool)), CLOCK)
    assert not plain.shifts_px.any()


@pytest.mark.parametrize("speed", [3.0, 3.1, 3.25])
def test_noise_of_a_steady_motion_is_not_smoothed_away(speed):
    """All displacements lie alike between half pixels there, and noise is all that varies."""
    rng = np.random.default_rng(4)
    noise = 0.02 * rng.standard_normal((60, 2))
    place = speed * np.arange(60.0)[:, None] + noise
    (mended,) = mended_places(
        [(place, np.tile(1e-4**2 * np.eye(2), (60, 1, 1)))], Coding(coded(60))
    )
    assert np.std(mended - place + noise) == pytest.approx(np.std(noise), rel=0.1)


def test_gaps_and_short_tracks_are_left_as_they_are():
    noise = np.tile(0.005**2 * np.eye(2), (FRAMES, 1, 1))
    place = ACCELERATED.copy()
    place[20:24] = np.nan
    (mended,) = mended_places([(place, noise)], CODING)
    np.testing.assert_array_equal(np.isnan(mended), np.isnan(place))
    (short,) = mended_places([(place[:5], noise[:5])], Coding(coded(5)))
    np.testing.assert_array_equal(short, place[:5])
    (empty,) = mended_places([(place[:0], noise[:0])], Coding(coded(0)))
    assert empty.shape == (0, 2)


def test_a_view_that_is_drawn_anew_is_mended_in_the_pixels_that_were_coded():
    rng = np.random.default_rng(5)
    place, noise = seen(ACCELERATED, np.array([0.0, -0.03, 0.0]), coded(), rng)
    view = Coding(coded(), lambda px: px / 1.3 - 7.0, lambda px: 1.3 * (px + 7.0))
    (plain,) = mended_places([(place, noise)], CODING)
    (mended,) = mended_places([(view.from_coded(place), noise)], view)
    np.testing.assert_allclose(view.to_coded(mended), plain, atol=1e-6)


def test_what_turns_is_coded_anew():
    rng = np.random.default_rng(6)
    place, noise = seen(ACCELERATED, np.array([0.0, -0.03, 0.0]), coded(), rng)
    angle = np.where(TIME < 45, 0.0, 0.05 * (TIME - 45))
    (turning,) = mended_places([(place, noise)], CODING, angle)
    (plain,) = mended_places([(place, noise)], CODING)
    np.testing.assert_array_equal(turning[:46], plain[:46])
    np.testing.assert_array_equal(turning[46:], place[46:])

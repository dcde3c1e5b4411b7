"""Alignment against known shifts and turns; the rigid motion; the noise terms."""

import cv2
import numpy as np
import pytest

from galileo_jax.tracking.alignment import FINE_PX, align, covariance_of
from galileo_jax.tracking.features import rigid_motion
from galileo_jax.tracking.noise import (
    AFTER_BLOW_SCALE2,
    BLOW_KNOWN_TO,
    FAST_PX,
    SETTLES_FRAMES,
    SLOW_SCALE2,
    after_blow_scale2,
    blow_shift,
    is_in_motion,
    motion_scale2,
    motion_variance,
    slow_scale2,
    speed_scale2,
)
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.pose import rotation
from galileo_jax.tracking.template import Outline, grey, template_at
from tests.tracking.moving_box import Box, film

BOX = Box()
OUTLINE = Outline(BOX.size_px)
START = np.array([60.0, 50.0, 0.0])
ALIGNED_PX = 0.02
"""Interpolation error of Lanczos sampling, measured 0.005 px; bicubic has 0.048."""


def grey_picture(pose, noise=0.0, seed=1):
    return grey(film([(BOX, np.array([pose]))], size_px=(120, 100), noise=noise, seed=seed)[0])


def picture(pose, noise=0.0, seed=1):
    return Picture(grey_picture(pose, noise, seed))


@pytest.fixture(scope="module")
def target():
    template = template_at(grey_picture(START), START[:2], OUTLINE)
    return template.target(np.zeros(3), FINE_PX)


@pytest.mark.parametrize("phase", [0.1, 0.25, 0.4, 0.5, 0.75, 0.9])
def test_alignment_is_not_drawn_to_whole_pixels(target, phase):
    pose = START + np.array([phase, -phase, 0.0])
    fit = align(picture(pose), target, START)
    assert np.abs(fit.pose[:2] - pose[:2]).max() < ALIGNED_PX
    assert fit.correlation > 0.999


@pytest.mark.parametrize("turn", [-0.1, 0.03, 0.12])
def test_alignment_finds_the_turn(target, turn):
    pose = START + np.array([0.6, 1.3, turn])
    fit = align(picture(pose), target, START)
    assert np.abs(fit.pose - pose)[:2].max() < ALIGNED_PX
    assert fit.pose[2] == pytest.approx(turn, abs=0.002)


@pytest.mark.parametrize("stretches", [False, True])
def test_covariance_of_white_noise_is_the_scatter(target, stretches):
    pose = START + np.array([0.3, 0.45, 0.01])
    pictures = [picture(pose, noise=6.0, seed=seed) for seed in range(60)]
    fits = [align(each, target, pose, stretches=stretches) for each in pictures]
    scatter = np.var([fit.pose[:2] for fit in fits], axis=0)
    stated = np.mean([np.diag(covariance_of(fit, target, stretches))[:2] for fit in fits], axis=0)
    # 60 draws know a variance to 18 %.
    np.testing.assert_allclose(scatter / stated, 1, atol=0.6)


def test_alignment_ignores_what_covers_a_quarter(target):
    pose = START + np.array([0.4, 0.2, 0.0])
    covered = grey_picture(pose, noise=2.0)
    covered[:, :52] = 170
    fit = align(Picture(covered), target, pose)
    assert 0.1 < fit.covered < 0.45
    assert np.abs(fit.pose[:2] - pose[:2]).max() < 0.05


def test_what_grows_is_not_shifted_towards_its_texture():
    """Nearly all texture is on one side of the point; a camera that is askew enlarges the box."""
    image = grey_picture(START)
    image[:, :60] = (0.9 * image[:, :60].mean() + 0.1 * image[:, :60]).round()
    target = template_at(image, START[:2], OUTLINE).target(np.zeros(3), FINE_PX)
    grown, middle = 1.01, START[:2]
    warp = np.column_stack([grown * np.eye(2), (1 - grown) * middle])
    larger = cv2.warpAffine(image, warp, image.shape[::-1], flags=cv2.INTER_LANCZOS4)
    rigid, stretched = (
        align(Picture(larger), target, START, stretches=each).pose[:2] for each in (False, True)
    )
    assert np.abs(rigid - middle).max() > 0.06
    assert np.abs(stretched - middle).max() < ALIGNED_PX


def test_rigid_motion_withstands_a_third_of_outliers():
    rng = np.random.default_rng(3)
    before = rng.uniform(0, 50, (30, 2))
    after = before @ rotation(0.2).T + (5.0, -3.0)
    after[:10] += rng.uniform(8, 30, (10, 2))
    motion = rigid_motion(before, after)
    assert motion is not None
    angle, shift = motion
    assert angle == pytest.approx(0.2, abs=1e-6)
    np.testing.assert_allclose(shift, (5.0, -3.0), atol=1e-4)


def test_rigid_motion_needs_three_points():
    assert rigid_motion(np.zeros((2, 2)), np.ones((2, 2))) is None


def noisy(place, sd, rng):
    return place + rng.normal(0, sd, place.shape), np.tile(1e-10 * np.eye(2), (len(place), 1, 1))


def test_scatter_beyond_the_stated_noise_is_found_along_the_motion_only():
    rng = np.random.default_rng(5)
    time = np.arange(200.0)
    smooth = np.stack([1.0 * time + 0.01 * time**2, 0 * time], axis=1)
    assert motion_variance([noisy(smooth, 0, rng)], time) == pytest.approx(0, abs=1e-9)
    shaken, stated = noisy(smooth, (0.05, 1e-5), rng)
    x, y = np.sqrt(motion_variance([(shaken, stated)], time))
    assert x == pytest.approx(0.05, rel=0.2)
    assert y < 1e-4
    x, _ = motion_variance([(shaken, stated + 0.05**2 * np.eye(2))], time)
    assert x < 0.03**2


def test_uneven_times_are_no_scatter():
    rng = np.random.default_rng(5)
    time = np.cumsum(rng.choice([1.0, 1.4, 0.8, 3.0], 200))
    smooth = np.stack([2.0 * time + 0.01 * time**2, 0 * time], axis=1)
    assert motion_variance([noisy(smooth, 0, rng)], time) == pytest.approx(0, abs=1e-9)
    shaken, stated = noisy(smooth, (0.05, 1e-5), rng)
    x, _ = np.sqrt(motion_variance([(shaken, stated)], time))
    assert x == pytest.approx(0.05, rel=0.2)
    taken_as_even, _ = np.sqrt(motion_variance([(shaken, stated)], np.arange(200.0)))
    assert taken_as_even > 1.0


def test_what_scatters_more_the_faster_it_is_scatters_as_much_as_it_does_when_slow():
    rng = np.random.default_rng(9)
    time = np.arange(400.0)
    fast = np.stack([10 * time + 0.1 * time**2, 0 * time], axis=1)
    grown = np.sqrt(speed_scale2(fast))
    assert grown[-1] == pytest.approx(np.sqrt(1 + (89.7 / FAST_PX) ** 2))
    scatter = np.stack([0.02 * grown, 1e-5 * grown], axis=1)
    found = [motion_variance([noisy(fast, scatter, rng)], time)[0] for _ in range(10)]
    assert np.sqrt(np.mean(found)) == pytest.approx(0.02, rel=0.05)
    hidden = np.where(time[:, None] == 7, np.nan, fast)
    assert (speed_scale2(hidden)[7:9] == 1).all()


def test_along_an_axis_where_hardly_anything_moves_a_coder_is_late():
    place = np.stack([0.4 * np.arange(8.0), 0.02 * np.arange(8.0)], axis=1)
    place[5:] = place[5]  # at rest from there on
    noise = 0.001**2 * np.tile(np.eye(2), (8, 1, 1))
    scale2 = slow_scale2(place, noise)
    np.testing.assert_array_equal(scale2[:6, 0], 1.0)
    assert scale2[6, 0] == SLOW_SCALE2, "it may have moved in the course of the last step"
    np.testing.assert_array_equal(scale2[1:7, 1], SLOW_SCALE2)
    np.testing.assert_array_equal(scale2[7], 1.0)
    assert (slow_scale2(place, 100 * noise)[:, 1] == 1.0).all(), "noise is no motion"


def test_an_object_that_scatters_otherwise_than_is_stated_says_so():
    rng = np.random.default_rng(8)
    time = np.arange(400.0)
    path = np.stack([1.0 * time + 0.01 * time**2, 0 * time], axis=1)
    stated = np.tile(0.02**2 * np.eye(2), (400, 1, 1))
    for own in (0.01, 0.02, 0.03):
        shaken = path + own * rng.standard_normal(path.shape)
        x, y = motion_scale2(shaken, stated, time)
        assert x == pytest.approx((own / 0.02) ** 2, rel=0.3)
        assert y == 1.0  # nothing moves there
    few, _ = motion_scale2(shaken[:8], stated[:8], time[:8])
    assert few == 1.0


def test_blows_are_not_taken_for_scatter():
    rng = np.random.default_rng(7)
    time = np.arange(40.0)
    bent = np.stack([6 * np.abs(time - 9.7) + 4 * np.abs(time - 21.3), 0 * time], axis=1)
    x, _ = np.sqrt(motion_variance([noisy(bent, (0.02, 1e-5), rng)], time))
    assert x == pytest.approx(0.02, rel=0.5)


def test_motion_is_told_from_noise_on_each_axis():
    rng = np.random.default_rng(6)
    time = np.arange(100.0)
    path = np.stack([np.maximum(time - 50, 0) * 2, 0 * time], axis=1)
    path += rng.normal(0, 0.01, path.shape)
    moves = is_in_motion(path, np.tile(0.01**2 * np.eye(2), (100, 1, 1)))
    assert not moves[:50].any()
    assert moves[50:, 0].all()
    assert not moves[:, 1].any()


def test_what_has_come_to_rest_still_counts_as_moving_for_some_frames():
    path = np.stack([np.minimum(np.arange(60.0), 30.0), np.zeros(60)], axis=1)
    moves = is_in_motion(path, np.tile(0.01**2 * np.eye(2), (60, 1, 1)))[:, 0]
    assert moves[: 31 + SETTLES_FRAMES].all() and not moves[31 + SETTLES_FRAMES :].any()


def test_where_a_blow_begins_a_motion_errors_are_larger():
    """Not where a slide begins by and by, nor where what moves is hit once more."""
    time, few = np.arange(60.0), np.tile(0.01**2 * np.eye(2), (60, 1, 1))
    hit = np.maximum(time - 20.4, 0) * 3.0
    hit_again = hit + np.maximum(time - 40.2, 0) * 3.0
    slides = 0.6 * np.maximum(time - 20, 0) ** 2  # steps of 0.6, 1.8, 3.0 px
    scale2 = after_blow_scale2(np.stack([hit_again, 0 * time], axis=1), few)
    assert np.flatnonzero(scale2[:, 0] > 1).tolist() == [21, 22]
    assert scale2[21:23, 0].tolist() == list(AFTER_BLOW_SCALE2)
    assert (scale2[:, 1] == 1).all()
    assert (after_blow_scale2(np.stack([slides, 0 * time], axis=1), few) == 1).all()
    moves_at_first = np.stack([3.0 * time, 0 * time], axis=1)  # and may have moved before
    assert (after_blow_scale2(moves_at_first, few) == 1).all()
    late = after_blow_scale2(np.stack([hit, 0 * time], axis=1)[:22], few[:22])  # the clip ends
    assert late[:, 0].tolist() == [1.0] * 21 + [AFTER_BLOW_SCALE2[0]]


@pytest.mark.parametrize("instant", [0.0, 0.05, 0.12, 0.3])
def test_a_blow_within_an_exposure_shifts_the_picture_by_about_what_is_told(instant):
    share, blow_at = 0.4, 10 + instant

    def place(time):
        return 3.0 * time - 9.0 * np.maximum(time - blow_at, 0)

    frames = np.arange(20.0)
    exposure = share * (np.arange(400) - 199.5) / 400
    shown = place(frames[:, None] + exposure).mean(axis=1)
    jumps = np.zeros((20, 2))
    jumps[1:-1, 0] = np.diff(shown, n=2)
    expected = shown - place(frames)
    shift = blow_shift(jumps, share)[:, 0]
    np.testing.assert_allclose(shift, expected, rtol=BLOW_KNOWN_TO, atol=0.005)
    assert (np.abs(expected).max() > 0.01) == (instant < share / 2)

"""Alignment against known shifts and turns; the rigid motion; the noise terms."""

import numpy as np
import pytest

from galileo_jax.tracking.noise import blow_covariance, scatter_variance
from galileo_jax.tracking.pose import rotation
from galileo_jax.tracking.refine import FINE_PX, align, covariance_of
from galileo_jax.tracking.rigid import rigid_motion
from galileo_jax.tracking.template import Outline, grey, template_at
from tests.tracking.moving_box import Box, film

BOX = Box()
OUTLINE = Outline(BOX.size_px)
START = np.array([60.0, 50.0, 0.0])
ALIGNED_PX = 0.02
"""Interpolation error of Lanczos sampling, measured 0.005 px; bicubic has 0.048."""


def picture(pose, noise=0.0, seed=1):
    return grey(film([(BOX, np.array([pose]))], size_px=(120, 100), noise=noise, seed=seed)[0])


@pytest.fixture(scope="module")
def target():
    template = template_at(picture(START), START[:2], OUTLINE)
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


def test_covariance_of_white_noise_is_the_scatter(target):
    pose = START + np.array([0.3, 0.45, 0.01])
    fits = [align(picture(pose, noise=6.0, seed=seed), target, pose) for seed in range(60)]
    scatter = np.var([fit.pose[:2] for fit in fits], axis=0)
    stated = np.mean([np.diag(covariance_of(fit, target))[:2] for fit in fits], axis=0)
    # 60 draws know a variance to 18 %.
    np.testing.assert_allclose(scatter / stated, 1, atol=0.6)


def test_alignment_ignores_what_covers_a_quarter(target):
    pose = START + np.array([0.4, 0.2, 0.0])
    covered = picture(pose, noise=2.0)
    covered[:, :52] = 170
    fit = align(covered, target, pose)
    assert 0.1 < fit.covered < 0.45
    assert np.abs(fit.pose[:2] - pose[:2]).max() < 0.05


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


def test_scatter_beyond_the_stated_noise_is_found_and_smooth_motion_is_not():
    rng = np.random.default_rng(5)
    time = np.arange(200.0)
    smooth = np.stack([1.0 * time + 0.01 * time**2, 0.5 * time, 0 * time], axis=1)
    nothing = np.zeros((200, 2, 2))
    assert scatter_variance(smooth, nothing) == pytest.approx(0, abs=1e-12)
    shaken = smooth + rng.normal(0, 0.05, smooth.shape)
    np.testing.assert_allclose(np.sqrt(scatter_variance(shaken, nothing)), 0.05, rtol=0.2)
    assert scatter_variance(shaken, nothing + 0.05**2 * np.eye(2)).max() < 0.03**2
    assert not scatter_variance(0 * shaken, nothing).any()


def test_scatter_counts_only_while_the_object_moves():
    rng = np.random.default_rng(6)
    time = np.arange(100.0)
    path = np.stack([np.maximum(time - 50, 0) * 2, 0 * time, 0 * time], axis=1)
    path[51:] += rng.normal(0, 0.05, (49, 3))
    variance = scatter_variance(path, np.zeros((100, 2, 2)))
    assert not variance[:50].any()
    assert (variance[52:] > 0.03**2).all()


def test_only_a_blow_widens_the_covariance():
    jumps = np.tile([0.5, 0.0, 0.0], (20, 1))
    jumps[10] = [-8.0, 4.0, 0.0]
    covariance = blow_covariance(jumps, 0.4)
    assert not covariance[:10].any()
    np.testing.assert_allclose(covariance[10, 0, 0], (8.5 * 0.4 / 8) ** 2)

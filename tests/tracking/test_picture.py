"""Pictures read between their pixels: against the same Gaussian on a picture drawn there."""

import numpy as np
import pytest

from galileo_jax.tracking.picture import Picture

SMOOTHED = 0.8
"""Grey levels of 60: rounded pixels, half pixels and linear interpolation against the exact
Gaussian; a shift of a twentieth of a pixel is more."""


def waves(x, y):
    return 128 + 40 * np.sin(0.45 * x + 0.2 * y) + 20 * np.cos(0.31 * y - 0.5 * x)


@pytest.fixture(scope="module")
def picture():
    y, x = np.mgrid[:90, :120].astype(float)
    return Picture(np.round(waves(x, y)).astype(np.uint8))


def smoothed(x, y, width):
    """The waves after a Gaussian: each falls by exp(-k^2 width^2 / 2)."""
    slow, fast = (np.exp(-(a**2 + b**2) * width**2 / 2) for a, b in ((0.45, 0.2), (0.31, 0.5)))
    return 128 + slow * 40 * np.sin(0.45 * x + 0.2 * y) + fast * 20 * np.cos(0.31 * y - 0.5 * x)


@pytest.mark.parametrize("width", [0.8, 3.0])
@pytest.mark.parametrize("pose", [(60.0, 45.0, 0.0), (60.3, 44.8, 0.0), (50.27, 40.61, 0.4)])
def test_places_between_pixels_have_the_smoothed_value(picture, pose, width):
    own = np.stack(np.meshgrid(np.arange(-9.0, 10), np.arange(-7.0, 8))).reshape(2, -1)
    found = picture.at(np.array(pose), own.astype(np.float32), 12.0, width)
    c, s = np.cos(pose[2]), np.sin(pose[2])
    x, y = pose[0] + c * own[0] - s * own[1], pose[1] + s * own[0] + c * own[1]
    np.testing.assert_allclose(found, smoothed(x, y, width), atol=SMOOTHED)


def test_beyond_the_border_the_last_pixels_go_on():
    grey = np.tile(np.arange(0, 200, 5, dtype=np.uint8), (30, 1))
    own = np.array([[-20.0], [0.0]], np.float32)
    found = Picture(grey).at(np.array([3.0, 15.0, 0.0]), own, 20.0, 0.8)
    assert found[0] == pytest.approx(0.0, abs=3.0)


def test_a_large_thing_is_read_as_a_small_one():
    """Of more places than OpenCV takes in a row (a box of 200 px has them)."""
    y, x = np.mgrid[:260, :260].astype(float)
    large = Picture(np.round(waves(x, y)).astype(np.uint8))
    own = np.stack(np.meshgrid(np.arange(-100, 100), np.arange(-100, 100)))
    own = own.reshape(2, -1).astype(np.float32)
    pose, some = np.array([130.3, 129.6, 0.1]), slice(None, None, 997)
    found = large.at(pose, own, 142.0, 1.0)
    assert found.shape == (40000,)
    np.testing.assert_allclose(found[some], large.at(pose, own[:, some], 142.0, 1.0), atol=1e-3)

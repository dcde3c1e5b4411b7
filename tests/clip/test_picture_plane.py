"""Pixels to metres of a camera that is not square to the plane."""

from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.declaration import Declaration
from galileo_jax.clip.label import label_clip
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.picture_plane import picture_plane, scale_of_rectangle
from galileo_jax.clip.schema import Clip
from galileo_jax.runtime.errors import InputError
from galileo_jax.video.synthetic import Camera
from tests.clip.broken_clips import GOOD_YAML, build_good

CAMERA = Camera(300.0, (160.0, 150.0), (320, 180), keystone_per_m=(0.5, -0.3), roll_rad=0.05)
SIDES_M = np.array([[-0.4, -0.05], [0.3, -0.05], [0.3, 0.35], [-0.4, 0.35]])
FLOAT32_M = 1e-6  # OpenCV takes corners in single precision


def filmed(folder: Path, **extra: str) -> Clip:
    """The good clip, its scale told by a rectangle that the oblique camera sees."""
    build_good(folder)
    corners = CAMERA.project(SIDES_M).tolist()
    lines = [f"rectangle: {{corners_px: {corners}, sides_m: [0.7, 0.4]}}"]
    lines += [f"{key}: {value}" for key, value in extra.items()]
    text = GOOD_YAML.replace("pixels_per_metre: 300.0", "\n".join(lines))
    (folder / "clip.yaml").write_text(text)
    return load_clip(folder / "clip.yaml")


def test_the_rectangle_takes_the_obliqueness_out(tmp_path: Path) -> None:
    clip = filmed(tmp_path)
    points = np.random.default_rng(0).uniform((-0.4, -0.05), (0.3, 0.35), (20, 2))
    seen = CAMERA.project(points)
    plane = picture_plane(clip, CAMERA.origin_px)
    assert plane.to_metres(seen) == pytest.approx(points, abs=FLOAT32_M)
    assert plane.to_pixels(points) == pytest.approx(seen, abs=1e-3)
    mirrored = clip.model_copy(update={"direction": "left"})
    left = picture_plane(mirrored, CAMERA.origin_px)
    assert left.to_metres(seen) == pytest.approx(points * (-1, 1), abs=FLOAT32_M)
    assert left.to_pixels(points * (-1, 1)) == pytest.approx(seen, abs=1e-3)


def test_slope_is_the_derivative_and_the_scale_that_of_the_middle(tmp_path: Path) -> None:
    clip = filmed(tmp_path)
    middle = np.mean(np.array(CAMERA.project(SIDES_M)), axis=0)
    plane = picture_plane(clip, middle)
    step = np.array([0.1, 0.0])
    moved = plane.to_metres(middle + step) - plane.to_metres(middle - step)
    assert plane.slope(middle)[:, 0] == pytest.approx(moved / 0.2, rel=1e-4)
    assert clip.pixels_per_metre == scale_of_rectangle(clip)
    here = picture_plane(clip, CAMERA.origin_px).to_metres(middle)
    steps = 1e-4 * np.eye(2)
    drawn = (CAMERA.project(here + steps) - CAMERA.project(here - steps)) / 2e-4
    assert clip.pixels_per_metre == pytest.approx(abs(np.linalg.det(drawn)) ** 0.5, rel=1e-4)


def test_a_lens_is_taken_out_and_put_back(tmp_path: Path) -> None:
    clip = filmed(tmp_path, lens="{k1: -0.1}")
    plane = picture_plane(clip, (160.0, 150.0))
    points = np.array([[10.0, 10.0], [160.0, 90.0], [300.0, 170.0]])
    assert plane.to_pixels(plane.to_metres(points)) == pytest.approx(points, abs=1e-6)
    # A corner of the picture, half a diagonal from its middle, is drawn at 0.9 half diagonals.
    straight = plane._straight(np.array([159.5, 89.5]) + 0.9 * np.array([159.5, 89.5]))
    unit = np.hypot(320, 180) / 2
    true = np.hypot(*(straight - (159.5, 89.5))) / unit
    seen = 0.9 * np.hypot(159.5, 89.5) / unit
    assert true * (1 - 0.1 * true**2) == pytest.approx(seen, rel=1e-9)


def test_a_ramp_read_off_an_oblique_picture(tmp_path: Path) -> None:
    clip = filmed(tmp_path)
    ends = CAMERA.project(np.array([[-0.3, 0.3 * np.tan(np.radians(20))], [0.0, 0.0]]))
    made = label_clip(clip.path, Declaration(ramp=ends.ravel().tolist())).clip
    assert made.ramp_angle_deg == pytest.approx(20.0, abs=0.01)
    # Half a pixel at either end of 96 px across it: 0.4 degrees; the corners add to it.
    assert 0.4 < made.ramp_angle_sd_deg < 0.7
    apart = CAMERA.project(np.array([[0.0, 0.0], [0.1, 0.0]]))
    scaled = label_clip(clip.path, Declaration(scale=[*apart.ravel().tolist(), 0.1])).clip
    assert scaled.rectangle is None
    corners = CAMERA.project(SIDES_M).ravel().tolist()
    again = label_clip(clip.path, Declaration(rectangle=[*corners, 0.7, 0.4], lens=[-0.01, 0.02]))
    assert again.clip.rectangle == clip.rectangle
    assert again.clip.lens is not None and again.clip.lens.k1_sd == 0.02


def test_two_scales_in_a_call_are_one_too_many(tmp_path: Path) -> None:
    clip = filmed(tmp_path)
    with pytest.raises(InputError, match="rectangle: given together with pixels_per_metre"):
        load_clip(clip.path, pixels_per_metre=300.0)
    with pytest.raises(InputError, match="--scale: not allowed with --rectangle"):
        label_clip(clip.path, Declaration(scale=[0, 0, 1, 0, 1], rectangle=[0.0] * 10))

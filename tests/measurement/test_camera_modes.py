"""A board that is filmed obliquely, and how well its rectangle is known."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

import galileo_jax as gx
from galileo_jax.clip.picture_plane import nearby_planes
from galileo_jax.measurement.in_metres import observe
from galileo_jax.measurement.measure import Measurement, measure
from galileo_jax.video.decode import frames
from tests.clip.test_picture_plane import filmed

SEED = 41
SIZE = (640, 360)
CLICK_SD_PX = 0.5
# Corners of the picture as the oblique camera shows them: some 20 degrees of yaw, 8 of tilt.
SEEN_CORNERS = np.array([[40, 20], [600, 70], [590, 300], [50, 345]], np.float32)
K1 = 0.25


def oblique(folder: Path, rectangle: bool) -> Path:
    """A simulated slide down a board, its frames warped; the yaml says how, or only the scale."""
    plain = folder / "plain.mp4"
    gx.simulate(plain, scenario="incline", seed=SEED, angle=24.0, k1=K1, fps=60.0, size=SIZE)
    declared = yaml.safe_load(plain.with_suffix(".yaml").read_text())
    width, height = SIZE
    before = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    warp = cv2.getPerspectiveTransform(before, SEEN_CORNERS)
    out = folder / f"oblique_{rectangle}.mp4"
    writer = cv2.VideoWriter(str(out), cv2.VideoWriter.fourcc(*"mp4v"), 60.0, SIZE)
    for frame in frames(plain):
        writer.write(cv2.warpPerspective(frame, warp, SIZE, flags=cv2.INTER_CUBIC))
    writer.release()
    scale = declared.pop("pixels_per_metre")
    for item in declared["objects"]:
        point = np.array([[item["point_px"]]], float)
        item["point_px"] = cv2.perspectiveTransform(point, warp)[0, 0].tolist()
    declared["video"] = out.name
    declared.pop("origin_px", None)
    declared["ramp_angle_sd_deg"] = 0.0
    if rectangle:
        sheet = np.array([[[80, 320]], [[560, 320]], [[560, 40]], [[80, 40]]], float)
        corners = cv2.perspectiveTransform(sheet, warp)[:, 0]
        corners += CLICK_SD_PX * np.random.default_rng(SEED).standard_normal((4, 2))
        declared["rectangle"] = {
            "corners_px": corners.tolist(),
            "sides_m": [480 / scale, 280 / scale],
        }
    else:
        declared["pixels_per_metre"] = scale
    out.with_suffix(".yaml").write_text(yaml.safe_dump(declared))
    return out


@pytest.mark.video
def test_friction_of_a_board_filmed_obliquely(tmp_path: Path) -> None:
    found = gx.fit(oblique(tmp_path, rectangle=True)).result["parameters"]["k1"]
    assert found["q025"] < K1 < found["q975"], found
    assert found["sd"] < 0.02
    told = gx.fit(oblique(tmp_path, rectangle=False), discrepancy="none")
    fooled = told.result["parameters"]["k1"]
    assert abs(fooled["mean"] - K1) > 5 * fooled["sd"], fooled


def measured(folder: Path) -> Measurement:
    return measure(gx.load(oblique(folder, rectangle=True)))


@pytest.mark.video
def test_modes_are_what_half_a_pixel_of_a_corner_does(tmp_path: Path) -> None:
    one = measured(tmp_path)
    modes = one.observation.modes_m
    assert modes is not None
    modes = modes[: len(modes) - one.observation.num_errors]
    assert modes.shape == (8, *one.observation.position_m.shape)
    assert one.observation.is_squared
    rectangle = one.clip.rectangle
    assert rectangle is not None and one.pixels is not None
    corners = np.array(rectangle.corners_px)
    corners[2, 0] += CLICK_SD_PX
    moved = rectangle.model_copy(update={"corners_px": tuple(map(tuple, corners.tolist()))})
    other = observe(one.clip.model_copy(update={"rectangle": moved}), one.pixels)
    seen = one.observation.mask[0]
    difference = (other.position_m - one.observation.position_m)[0][:, seen]
    size = np.abs(difference).max()
    assert size > 1e-4
    assert np.abs(difference - modes[4, 0][:, seen]).max() < 0.05 * size


def test_a_lens_that_is_not_known_well_is_a_mode(tmp_path: Path) -> None:
    clip = filmed(tmp_path, lens="{k1: -0.05, k1_sd: 0.02}")
    pairs = nearby_planes(clip, (160.0, 150.0))
    assert len(pairs) == 9
    more, less = pairs[-1]
    assert (more.k1, less.k1) == pytest.approx((-0.03, -0.07))

"""The foot of the ramp from the bend of the path."""

import math
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.load import load_clip
from galileo_jax.measurement.measure import _as_discs, measure
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.clip import outline_of

SCALE_PX_PER_M = 600.0
FOOT_PX = (700.0, 520.0)
HALF_HEIGHT_M = 0.04
YAML = """\
track: slide.csv
track_y: down
scenario: ramp
ramp_angle_deg: {angle}
direction: {direction}
pixels_per_metre: {scale}
objects: [{{name: object1, shape: box, size_m: {size}}}]
"""


def write_track(
    folder: Path,
    angle_deg: float = 20.0,
    direction: str = "right",
    declared: str = "20.0",
    size: str = "[0.06, 0.05, 0.08]",
    num_frames: int = 60,
) -> Path:
    """A box's centre in pixels, which turns at the bisector of ramp and table."""
    times, angle = np.arange(num_frames) / 30, math.radians(angle_deg)
    gone = -0.4 + 0.5 * 1.8 * np.minimum(times, 1.2) ** 2 + 0.8 * np.clip(times - 1.2, 0, None)
    corner = np.array([HALF_HEIGHT_M * math.tan(angle / 2), HALF_HEIGHT_M])
    on_ramp, on_table = np.minimum(gone, 0), np.maximum(gone, 0)
    x = corner[0] + on_ramp * math.cos(angle) + on_table
    y = corner[1] - on_ramp * math.sin(angle)
    sign = 1 if direction == "right" else -1
    place = [FOOT_PX[0] + sign * SCALE_PX_PER_M * x, FOOT_PX[1] - SCALE_PX_PER_M * y]
    place = np.array(place) + np.random.default_rng(3).normal(0, 0.3, (2, num_frames))
    rows = [f"{t:.6f},{a:.3f},{b:.3f}" for t, a, b in zip(times, *place, strict=True)]
    (folder / "slide.csv").write_text("\n".join(["t (s),x (px),y (px)", *rows]) + "\n")
    path = folder / "slide.yaml"
    path.write_text(
        YAML.format(angle=declared, direction=direction, scale=SCALE_PX_PER_M, size=size)
    )
    return path


@pytest.mark.parametrize("declared", ["20.0", "null"])
@pytest.mark.parametrize("direction", ["right", "left"])
@pytest.mark.parametrize("angle_deg", [10.0, 20.0, 30.0])
def test_foot(angle_deg: float, direction: str, declared: str, tmp_path: Path) -> None:
    declared = declared if declared == "null" else str(angle_deg)
    measured = measure(load_clip(write_track(tmp_path, angle_deg, direction, declared)))
    # 0.3 px of noise in 20 points before and after, 0.4 m from the bend: under a pixel.
    assert measured.clip.origin_px == pytest.approx(FOOT_PX, abs=1.5)
    assert measured.inferred["origin_px"]["mean"] == list(measured.clip.origin_px or ())
    assert measured.clip.ramp_angle_deg == pytest.approx(angle_deg, abs=0.2)
    assert ("ramp_angle_deg" in measured.inferred) == (declared == "null")
    lines = measured.remarks
    assert "origin_px: null; " in lines[0]
    assert len(lines) == len(measured.inferred)


def test_a_first_look_follows_the_disc_that_fits_into_a_box(tmp_path: Path) -> None:
    """Its turn is not known yet, and a plain box is followed by its label, wherever that is."""
    clip = load_clip(write_track(tmp_path))
    (seen,) = _as_discs(clip, origin_px=FOOT_PX).objects
    outline = outline_of(clip, seen)
    assert outline.is_round and outline.size_px == pytest.approx((36.0, 36.0))
    assert clip.objects[0].shape == "box"


@pytest.mark.parametrize("change, words", [
    ({"angle_deg": 1.5}, "path does not bend"),
    ({"num_frames": 15}, "path does not bend"),
])  # fmt: skip
def test_what_cannot_be_told_is_one_line(change: dict, words: str, tmp_path: Path) -> None:
    clip = load_clip(write_track(tmp_path, **change))
    with pytest.raises(InputError) as caught:
        measure(clip)
    assert words in str(caught.value)
    assert "galileo label --origin" in str(caught.value)


def test_a_body_without_a_size_is_taken_to_be_as_high_as_long(tmp_path: Path) -> None:
    """Where its centre goes along the table is then the table."""
    measured = measure(load_clip(write_track(tmp_path, size="null")))
    assert measured.clip.origin_px is not None
    x, y = measured.clip.origin_px
    shift = np.array([math.tan(math.radians(10)), 1.0]) * HALF_HEIGHT_M * SCALE_PX_PER_M
    assert (x, y) == pytest.approx(FOOT_PX + shift * [1, -1], abs=1.5)
    assert np.median(measured.observation.position_m[0, 1, -5:]) == pytest.approx(0.0, abs=2e-3)


TABLE = """\
track: slide.csv
scenario: ramp
ramp_angle_deg: 20.0
objects: [{{name: object1, shape: box{size}}}]
{more}
"""


def in_millimetres(folder: Path, foot_mm: tuple[float, float], y_axis: str) -> Path:
    """The slide of `write_track` in a table of another program, whose origin is anywhere."""
    path = write_track(folder)
    t, x, y = np.loadtxt(folder / "slide.csv", delimiter=",", skiprows=1).T
    x = 1e3 * (x - FOOT_PX[0]) / SCALE_PX_PER_M + foot_mm[0]
    y = 1e3 * (FOOT_PX[1] - y) / SCALE_PX_PER_M * (1 if y_axis == "up" else -1) + foot_mm[1]
    rows = [f"{a:.4f},{b:.2f},{c:.2f}" for a, b, c in zip(t, x, y, strict=True)]
    (folder / "slide.csv").write_text("\n".join(["t (s),x (mm),y (mm)", *rows]) + "\n")
    return path


@pytest.mark.parametrize("y_axis", ["up", "down"])
@pytest.mark.parametrize("size", ["", ", size_m: [0.06, 0.05, 0.08]"])
@pytest.mark.parametrize("foot_mm", [(0.0, 0.0), (-300.0, 120.0), (410.0, -75.0)])
def test_the_origin_of_a_table_may_be_anywhere(foot_mm, size, y_axis, tmp_path: Path) -> None:
    path = in_millimetres(tmp_path, foot_mm, y_axis)
    path.write_text(TABLE.format(size=size, more=""))
    found = measure(load_clip(path))
    assert ("foot_m" in found.inferred) == (foot_mm != (0.0, 0.0))
    x, y = found.observation.position_m[0]
    height_m = (found.clip.objects[0].size_m or (0.0,))[-1] / 2
    if size:
        assert height_m == HALF_HEIGHT_M
    # The bend of the centre's path, wherever the table is.
    assert np.median(y[x > 0.1]) == pytest.approx(height_m, abs=2e-3)
    on_ramp = x < -0.1
    above = y[on_ramp] * np.cos(np.radians(20)) + x[on_ramp] * np.sin(np.radians(20))
    assert np.median(above) == pytest.approx(height_m, abs=2e-3)


def test_a_declared_origin_of_a_table_is_the_foot(tmp_path: Path) -> None:
    path = in_millimetres(tmp_path, (-300.0, 120.0), "up")
    path.write_text(TABLE.format(size="", more="track_origin: [0, 0]"))
    found = measure(load_clip(path))
    assert "foot_m" not in found.inferred
    assert found.observation.position_m[0, 0, 0] == pytest.approx(-0.3 - 0.37, abs=0.01)

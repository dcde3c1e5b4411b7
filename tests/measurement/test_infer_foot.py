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
    ({"size": "null"}, "object1's size_m is null, too"),
])  # fmt: skip
def test_what_cannot_be_told_is_one_line(change: dict, words: str, tmp_path: Path) -> None:
    clip = load_clip(write_track(tmp_path, **change))
    with pytest.raises(InputError) as caught:
        measure(clip)
    assert words in str(caught.value)
    assert "galileo label --origin" in str(caught.value)

"""Clips made by others, with truth or an expert's marks beside them."""

import csv
import json

import numpy as np
import pytest

from benchmarks.tracking import rows_of
from galileo_jax.clip.load import load_clip
from galileo_jax.tracking.clip import track_clip

pytestmark = pytest.mark.video

WORST_RMS_PX = 0.1
"""The bar is 0.3 px median, 0.6 px worst; measured on 22 clips: 0.016 and 0.07."""


@pytest.mark.parametrize(
    "name", ["dev_coulomb_none_0", "dev_bullet_restitution_1", "dev_coulomb_release_delay_0"]
)
def test_rendered_clip_against_its_truth(shared_data, name):
    clip = load_clip(shared_data / "ramp" / f"{name}.yaml")
    truth = json.loads((shared_data / "ramp" / f"{name}.truth.json").read_text())
    for row in rows_of(clip, truth, track_clip(clip), 0.0):
        assert row.rms < WORST_RMS_PX
        assert row.lost == 0
        assert 0.25 < row.nse < 3


def test_thrown_ball_against_the_experts_marks(shared_data):
    clip = load_clip(shared_data / "real" / "ball_toss.yaml")
    track = track_clip(clip)
    with (shared_data / "real" / "ball_toss.expert.csv").open() as file:
        marks = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    for mark in marks:
        frame = int(mark["frame"])
        assert track.is_visible[0, frame]
    found = np.array([track.position_px[0, int(mark["frame"])] for mark in marks])
    expected = np.array([[mark["x_px"], mark["y_px"]] for mark in marks])
    assert np.sqrt(((found - expected) ** 2).sum(axis=1).mean()) < 1.0  # bar: 2 px
    assert not track.is_visible[0, : clip.objects[0].first_frame].any()


@pytest.mark.slow
@pytest.mark.parametrize(("name", "last_frame"), [("slide_r1", 375), ("slide_r2", 400)])
def test_real_slide_is_followed_to_the_end_of_the_board(shared_data, name, last_frame):
    clip = load_clip(shared_data / "real" / f"{name}.yaml")
    track = track_clip(clip)
    assert track.is_visible[0, :last_frame].all()
    assert track.position_px[0, last_frame, 0] < 40  # the board ends at 25 px
    # Straight down the board: no point is off the line.
    x, y = track.position_px[0, :last_frame].T
    off = y - np.polyval(np.polyfit(x, y, 1), x)
    assert np.abs(off).max() < 1.0
    assert not track.is_visible[0, last_frame + 40 :].any()

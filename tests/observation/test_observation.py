"""Pixels to metres: axes, scale, covariance, velocities."""

from dataclasses import replace

import numpy as np
import pytest

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.in_metres import observe
from galileo_jax.numerics.units import NOMINAL_SCALE_PX_PER_M
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.track import Track

PX = np.array([[[310.0, 150.0], [320.0, 160.0], [330.0, 175.0]]])
COVARIANCE_PX2 = np.broadcast_to(np.array([[0.04, 0.01], [0.01, 0.09]]), (1, 3, 2, 2))


@pytest.fixture
def track():
    return Track(
        names=("object1",),
        times_s=np.arange(3) / 30,
        position_px=PX,
        covariance_px2=COVARIANCE_PX2,
        common_px2=np.zeros_like(COVARIANCE_PX2),
        shifts_px=np.zeros((*COVARIANCE_PX2.shape[:2], 1, 2)),
        angle_rad=np.zeros((1, 3)),
        is_visible=np.ones((1, 3), bool),
        frame_size_px=(640, 360),
    )


def clip(tmp_path, **keys):
    content = {"direction": "right", "pixels_per_metre": 500.0, "origin_px": (300.0, 200.0)} | keys
    return Clip(
        path=tmp_path / "clip.yaml",
        video=tmp_path / "clip.mp4",
        track=None,
        scenario="ramp",
        fps=30.0,
        frame_count=3,
        ramp_angle_deg=20.0,
        objects=(
            ClipObject(name="object1", shape="box", first_frame=content.pop("first_frame", 0)),
        ),
        **content,
    )


@pytest.mark.parametrize("direction, sign", [("right", 1), ("left", -1)])
def test_x_is_along_the_travel_and_y_is_up(tmp_path, track, direction, sign):
    seen = observe(clip(tmp_path, direction=direction), track)
    assert seen.position_m[0, 0] == pytest.approx(sign * np.array([0.02, 0.04, 0.06]))
    assert seen.position_m[0, 1] == pytest.approx([0.1, 0.08, 0.05])
    expected = np.array([[0.04, -sign * 0.01], [-sign * 0.01, 0.09]]) / 500**2
    assert seen.covariance_m2[0, :, :, 1] == pytest.approx(expected)


def test_velocity_profile(tmp_path, track):
    seen = observe(clip(tmp_path), track)
    assert seen.velocity_m_s.shape == (1, 2, 2)
    assert seen.velocity_m_s[0, 0] == pytest.approx([0.6, 0.6])
    assert seen.velocity_m_s[0, 1] == pytest.approx([-0.6, -0.9])


def test_velocities_next_to_a_gap_are_unknown():
    position = np.array([[[0.0, np.nan, 0.2, 0.3]] * 2])
    covariance = np.zeros((1, 2, 2, 4))
    seen = Observation(("a",), np.arange(4) / 10, position, covariance, ~np.isnan(position[:, 0]))
    assert np.isnan(seen.velocity_m_s[0, 0]).tolist() == [True, True, False]


def test_without_origin_the_first_point_is_it(tmp_path, track):
    seen = observe(clip(tmp_path, origin_px=None), track)
    assert seen.position_m[0, :, 0] == pytest.approx([0.0, 0.0])


def test_without_scale_lengths_are_nominal(tmp_path, track):
    seen = observe(clip(tmp_path, pixels_per_metre=None), track)
    assert seen.position_m[0, 0, 0] == pytest.approx(10 / NOMINAL_SCALE_PX_PER_M)


def test_frames_before_the_first_are_not_measured(tmp_path, track):
    seen = observe(clip(tmp_path, first_frame=1), track)
    assert seen.mask.tolist() == [[False, True, True]]
    assert track.is_visible.all(), "the track is left as it is"


def test_nothing_seen_is_said(tmp_path, track):
    hidden = replace(track, is_visible=np.zeros((1, 3), bool))
    with pytest.raises(InputError, match="object1 is not seen in any frame"):
        observe(clip(tmp_path, origin_px=None), hidden)


def standing(sd_m: float, num: int = 30) -> Observation:
    """One object that stands still, with the errors that are stated."""
    errors = sd_m * np.random.default_rng(3).standard_normal((1, 2, num))
    covariance = np.tile(sd_m**2 * np.eye(2)[None, ..., None], (1, 1, 1, num))
    return Observation(
        ("object1",), np.arange(num) / 30, errors, covariance, np.ones((1, num), bool)
    )


@pytest.mark.parametrize("sd_m", [1e-6, 1e-3])
def test_the_frame_in_which_an_object_leaves_its_place(sd_m):
    """By more than its errors and a third of a millimetre; one outlier is no motion."""
    seen = standing(sd_m)
    assert seen.first_away(0) is None
    outlier = seen.position_m.copy()
    outlier[0, 0, 12] += 0.1
    assert replace(seen, position_m=outlier).first_away(0) is None
    moved = seen.position_m.copy()
    moved[0, 0, 20:] += 0.02
    assert replace(seen, position_m=moved).first_away(0) == 20
    creeps = seen.position_m + 2e-6 * np.arange(30)
    assert replace(seen, position_m=creeps).first_away(0) is None


def test_what_is_never_seen_leaves_no_place():
    seen = standing(1e-3)
    assert replace(seen, mask=np.zeros_like(seen.mask)).first_away(0) is None

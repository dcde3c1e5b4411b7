"""What a coder may shift an object by beside what was taken off is an error that lasts."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.in_metres import observe, with_coding_errors
from galileo_jax.tracking.motion_compensation import LASTS_FRAMES
from galileo_jax.tracking.track import Track

FRAMES, SCALE, NOISE_PX = 40, 800.0, 0.01
TIME = np.arange(float(FRAMES))
UNSEEN = 7
SHIFT = np.stack([0.005 * np.sin(TIME), 0.002 * np.cos(0.7 * TIME)], axis=1)


def seen(shifts: np.ndarray) -> tuple[Clip, Track]:
    """One object that moves along x, and what a coder may shift it by, `[frame, pattern, 2]`."""
    place = np.stack([2.0 * TIME, 0.0 * TIME], axis=1)[None]
    is_visible = np.ones((1, FRAMES), bool)
    is_visible[0, UNSEEN] = False
    shifts = np.where(np.arange(FRAMES)[:, None, None] == UNSEEN, np.nan, shifts)
    covariance = np.tile(NOISE_PX**2 * np.eye(2), (1, FRAMES, 1, 1))
    track = Track(
        ("one",), TIME / 60, place, covariance, np.zeros_like(covariance), shifts[None],
        np.zeros((1, FRAMES)), is_visible, (640, 360),
    )  # fmt: skip
    clip = Clip(
        path=Path("clip.yaml"),
        video=Path("clip.mp4"),
        track=None,
        scenario="incline",
        fps=60.0,
        frame_count=FRAMES,
        ramp_angle_deg=20.0,
        direction="right",
        pixels_per_metre=SCALE,
        origin_px=(0.0, 0.0),
        objects=(ClipObject(name="one", shape="box", size_m=(0.03, 0.01)),),
    )
    return clip, track


def test_it_wanders_along_its_pattern() -> None:
    clip, track = seen(SHIFT[:, None])
    before = observe(clip, track)
    found = with_coding_errors(clip, before, track)
    assert found.modes_m is not None
    assert found.num_errors == len(found.modes_m)
    flat = found.modes_m[:, 0].reshape(found.num_errors, -1)
    metres = np.where(TIME[:, None] == UNSEEN, 0.0, SHIFT * (1, -1) / SCALE).T
    apart = np.abs(TIME[:, None] - TIME)
    expected = np.einsum("if,jg,fg->ifjg", metres, metres, np.exp(-apart / LASTS_FRAMES))
    expected = expected.reshape(2 * FRAMES, 2 * FRAMES)
    error = np.abs(flat.T @ flat - expected).max()
    assert error < 0.1 * expected.max(), "but for the faintest of its patterns"
    np.testing.assert_array_equal(found.covariance_m2, before.covariance_m2)


def test_each_pattern_is_on_its_own() -> None:
    clip, track = seen(np.stack([SHIFT * (1, 0), SHIFT * (0, 1)], axis=1))
    found = with_coding_errors(clip, observe(clip, track), track)
    assert found.modes_m is not None
    along = np.abs(found.modes_m[:, 0]).max(axis=-1) > 0
    assert (along.sum(axis=1) == 1).all()
    assert along.any(axis=0).all()


@pytest.mark.parametrize("size", [0.0, 1e-4])
def test_of_a_lossless_video_nothing_is_left(size: float) -> None:
    clip, track = seen(size * SHIFT[:, None])
    before = observe(clip, track)
    assert with_coding_errors(clip, before, track) is before


def test_an_error_that_some_frames_have_in_common_is_one_of_all_these() -> None:
    clip, track = seen(np.zeros((FRAMES, 1, 2)))
    is_shifted = np.arange(FRAMES) < FRAMES // 2
    own = np.multiply.outer(4.0 * is_shifted, np.eye(2))[None]  # 2 px in either axis
    shifted = replace(track, common_px2=own, covariance_px2=track.covariance_px2 + own)
    found = with_coding_errors(clip, observe(clip, shifted), shifted)
    assert found.modes_m is not None and found.num_errors == 2
    flat = found.modes_m[:, 0].reshape(2, -1)
    used = np.where(is_shifted & (np.arange(FRAMES) != UNSEEN), 2.0 / SCALE, 0.0)
    expected = np.kron(np.eye(2), np.multiply.outer(used, used))
    np.testing.assert_allclose(flat.T @ flat, expected, atol=1e-12)
    np.testing.assert_allclose(found.covariance_m2, observe(clip, track).covariance_m2)
    every = np.tile(4.0 * np.eye(2), (1, FRAMES, 1, 1))
    of_all = replace(track, common_px2=every, covariance_px2=track.covariance_px2 + every)
    assert with_coding_errors(clip, observe(clip, of_all), of_all).modes_m is None

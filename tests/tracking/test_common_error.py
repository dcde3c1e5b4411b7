"""The error of an object's first frame, which all its points have in common."""

from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.measurement.in_metres import observe
from galileo_jax.tracking.fragments import Piece
from galileo_jax.tracking.motion_compensation import Coding
from galileo_jax.tracking.noise import MEMORY_FRAMES, SAMPLING_SD_PX
from galileo_jax.tracking.poses_to_track import Finished, finished, joined
from galileo_jax.tracking.refiner import Refined, velocities_at
from galileo_jax.tracking.square_view import square_view
from galileo_jax.tracking.track import Track
from tests.clip.test_picture_plane import CAMERA, SIDES_M, filmed

FRAMES = 10  # too few for own scatter to count: they have none
NOISE_PX2 = np.array([[0.04, 0.01], [0.01, 0.09]])
FIRST_PX2 = 4 * NOISE_PX2
SHUTTER = 0.0


class Whole(Piece):
    """A piece without a follower: nothing here looks at one."""

    def __init__(self) -> None:
        super().__init__(0, (50.0, 40.0), cast(Any, None))

    def velocities(self, poses: np.ndarray, frame: int, clock: np.ndarray) -> Any:
        return velocities_at(poses, frame, clock)


def followed(steps_px: np.ndarray) -> Finished:
    """The track of an object that goes so far to the right from frame to frame."""
    x = 50.0 + np.concatenate([[0.0], np.cumsum(steps_px)])
    fits = [
        Refined(np.array([at, 40.0, 0.0]), FIRST_PX2 if i == 0 else NOISE_PX2, 0.99, 0.0, 0.0)
        for i, at in enumerate(x)
    ]
    coding, clock = Coding(np.zeros(len(x), bool)), np.arange(float(len(x)))
    (found,) = finished([list(fits)], [Whole()], [SHUTTER], coding, clock)
    return found


def test_of_what_moves_at_once_it_is_that_of_the_first_frame() -> None:
    found = followed(np.full(FRAMES - 1, 8.0))
    assert found.common_px2 == pytest.approx(np.broadcast_to(FIRST_PX2, (FRAMES, 2, 2)))
    own = found.covariance_px2 - found.common_px2
    assert own[5] == pytest.approx(NOISE_PX2 + SAMPLING_SD_PX**2 * np.eye(2))


def test_of_what_lies_first_it_is_that_of_a_mean() -> None:
    rests = 6
    found = followed(np.where(np.arange(FRAMES - 1) < rests, 0.0, 8.0))
    # The last frame before it moves counts as moving.
    mean = (FIRST_PX2 + (rests - 1) * NOISE_PX2) / rests
    assert found.common_px2[-1] == pytest.approx(mean / (rests / MEMORY_FRAMES))
    assert (found.common_px2 == found.common_px2[0]).all()


def test_pieces_that_follow_each_other_have_none_in_common() -> None:
    whole = followed(np.full(FRAMES - 1, 8.0))
    begin, end = (
        Finished(*(np.where(np.expand_dims(kept, tuple(range(1, v.ndim))), v, np.nan)
                   for v in vars(whole).values()))
        for kept in (np.arange(FRAMES) < 5, np.arange(FRAMES) >= 5)
    )  # fmt: skip
    assert not joined([begin, end], FRAMES).common_px2.any()
    assert joined([whole], FRAMES).common_px2 == pytest.approx(whole.common_px2)


def seen_as(scenario: str) -> np.ndarray:
    """`[2, 2, frame]`, m^2: covariances of the followed object's places in metres."""
    found = followed(np.full(FRAMES - 1, 8.0))
    names, times = ("one",), np.arange(FRAMES) / 60
    track = Track(
        names, times, found.position_px[None], found.covariance_px2[None],
        found.common_px2[None], found.shifts_px[None], found.angle_rad[None],
        np.ones((1, FRAMES), bool), (640, 360),
    )  # fmt: skip
    clip = Clip(
        path=Path("clip.yaml"),
        video=Path("clip.mp4"),
        track=None,
        scenario=scenario,
        fps=60.0,
        frame_count=FRAMES,
        ramp_angle_deg=20.0,
        direction="right",
        pixels_per_metre=1000.0,
        origin_px=(0.0, 0.0),
        objects=(ClipObject(name="one", shape="cylinder", size_m=(0.03, 0.01)),),
    )
    return observe(clip, track).covariance_m2[0]


@pytest.mark.parametrize("scenario", ["from_above", "incline"])
def test_it_is_not_in_every_frame(scenario: str) -> None:
    """The likelihood has it as what it is: an offset; of a puck one that turns with it."""
    mirror = np.diag([1.0, -1.0])
    own = NOISE_PX2 + SAMPLING_SD_PX**2 * np.eye(2)
    assert seen_as(scenario)[..., 5] == pytest.approx(mirror @ own @ mirror / 1000**2)


def test_an_oblique_picture_has_it_in_its_own_pixels(tmp_path: Path) -> None:
    """As an error of the square view moves points of the picture."""
    clip = filmed(tmp_path)
    view = square_view(clip)
    there = view.from_picture(CAMERA.project(SIDES_M * 0.5))[None]
    covariance, common = (
        np.broadcast_to(one, (1, 4, 2, 2)) for one in (FIRST_PX2 + NOISE_PX2, FIRST_PX2)
    )
    of_view = Track(
        ("one",), np.arange(4) / 60, there, covariance, common, np.zeros((1, 4, 1, 2)),
        np.zeros((1, 4)), np.ones((1, 4), bool), view.size_px,
    )  # fmt: skip
    found = view.track(of_view, clip)
    for frame in range(4):
        step = 0.5
        slope = np.stack(
            [
                (view.to_picture(there[0, frame] + e) - view.to_picture(there[0, frame] - e))
                / (2 * step)
                for e in step * np.eye(2)
            ],
            axis=1,
        )
        assert found.common_px2[0, frame] == pytest.approx(slope @ FIRST_PX2 @ slope.T, rel=1e-2)
    alone = view.track(replace(of_view, covariance_px2=common), clip)
    assert found.common_px2 == pytest.approx(alone.covariance_px2)

"""Objects that their texture does not show well: plain, smeared, turning, thrown back."""

import cv2
import numpy as np
import pytest

from galileo_jax.tracking.fragments import Start
from galileo_jax.tracking.motion_compensation import Coding
from galileo_jax.tracking.poses_to_track import Finished, finished
from galileo_jax.tracking.refiner import Refined
from galileo_jax.tracking.second_opinion import ON_OBJECT, with_silhouette
from galileo_jax.tracking.silhouette import Part, Path, paths_of
from galileo_jax.tracking.template import Outline
from galileo_jax.tracking.tracker import track_video
from tests.tracking.test_common_error import Whole

pytestmark = pytest.mark.video

SIZE_PX = (160, 320)
RADIUS_PX = 9.0
SPREAD_PX = 0.5
"""Of the silhouettes' middles: noise of two grey levels and 8 bits make less."""


def picture(
    places: np.ndarray, turn: float = 0.0, camera: float = 0.0, contrast: float = 15, seed: int = 0
) -> np.ndarray:
    """A dark disc with a light mark off its middle, smeared over `places` `[sub-frame, 2]`."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(SIZE_PX[0]), np.arange(SIZE_PX[1]))
    ground = 170 + contrast * np.sin((x + camera) / 17) * np.cos(y / 23)
    total = np.zeros(x.shape)
    for at in places:
        inside = np.clip(RADIUS_PX + 0.5 - np.hypot(x - at[0], y - at[1]), 0, 1)
        mark = at + 5 * np.array([np.cos(turn), np.sin(turn)])
        light = np.clip(3.5 - np.hypot(x - mark[0], y - mark[1]), 0, 1)
        disc = 60 + 150 * light * (turn != 0)
        total += ground + inside * (disc - ground)
    grey = total / len(places) + rng.normal(0, 2.0, x.shape)
    return np.clip(np.round(grey), 0, 255).astype(np.uint8)


def film(path: np.ndarray, share: float = 0.0, turns: np.ndarray | None = None) -> list[np.ndarray]:
    """Pictures along `path` `[frame, 2]`, smeared by the open share of each frame's time."""
    velocity = np.gradient(path, axis=0)
    instants = np.linspace(-share / 2, share / 2, 9 if share else 1)
    turns = np.zeros(len(path)) if turns is None else turns
    return [
        picture(at + instants[:, None] * v, turn, seed=i)
        for i, (at, v, turn) in enumerate(zip(path, velocity, turns, strict=True))
    ]


def tracked(frames: list[np.ndarray], point: np.ndarray):
    outline = Outline((2 * RADIUS_PX, 2 * RADIUS_PX), is_round=True)
    start = Start("ball", (float(point[0]), float(point[1])), outline)
    return track_video(lambda: iter(frames), [start], np.arange(len(frames)) / 30.0)


def bouncing(frames: int = 15) -> np.ndarray:
    """Falls by 40 to 60 px a frame and is thrown back in the middle of a step."""
    time = np.arange(frames, dtype=float)
    down = 20 + 42 * time + 2 * time**2
    hit = 5.5
    floor, speed = 20 + 42 * hit + 2 * hit**2, 0.8 * (42 + 4 * hit)
    up = floor - speed * (time - hit) + 2 * (time - hit) ** 2
    return np.stack([30 + 4 * time, np.where(time < hit, down, up)], axis=1)


def test_a_fast_smeared_ball_that_bounces_is_followed():
    path = bouncing()
    track = tracked(film(path, share=0.5), path[0])
    assert track.is_visible[0].sum() >= 13
    off = np.hypot(*(track.position_px[0] - path).T)[track.is_visible[0]]
    assert np.median(off) < SPREAD_PX
    # In the frames about the bounce the velocity is not that of any moment.
    sd = np.sqrt(np.einsum("fii->f", track.covariance_px2[0]))
    assert sd[5:7].max() > 3 * np.nanmedian(sd)


def test_a_smear_is_followed_and_not_what_is_behind_it():
    path = np.stack([np.full(7, 80.0), 25 + 42.0 * np.arange(7)], axis=1)
    rng = np.random.default_rng(3)
    ground = cv2.resize(rng.normal(0, 25, (80, 40)), SIZE_PX, interpolation=cv2.INTER_CUBIC)
    frames = [np.clip(one + ground, 0, 255).astype(np.uint8) for one in film(path, share=0.9)]
    track = tracked(frames, path[0])
    seen = track.is_visible[0]
    assert seen.sum() >= 6
    assert np.abs(track.position_px[0][seen] - path[seen]).max() < 3


@pytest.mark.parametrize("click", [(0.0, 0.0), (1.0, 0.0), (0.0, -1.0), (2.0, 2.0)])
def test_one_pixel_beside_the_middle_does_not_decide(click):
    time = np.arange(30.0)
    fall = np.stack([np.full(30, 80.0), 30 + 0.35 * np.maximum(time - 5, 0) ** 2], axis=1)
    track = tracked(film(fall), fall[0] + click)
    assert track.is_visible[0].sum() >= 29
    seen = track.position_px[0][track.is_visible[0]]
    gone = seen - seen[0] - (fall[track.is_visible[0]] - fall[0])
    assert np.abs(gone).max() < SPREAD_PX
    half_acceleration = np.polyfit(time[6:], track.position_px[0, 6:, 1], 2)[0]
    assert half_acceleration == pytest.approx(0.35, rel=0.005)


def test_the_middle_of_what_turns_is_followed_not_its_mark():
    time = np.arange(50.0)
    x = 20 + 0.04 * time**2
    rolling = np.stack([x, np.full(50, 150.0)], axis=1)
    track = tracked(film(rolling, turns=0.01 + (x - 20) / RADIUS_PX), rolling[0])
    seen = track.is_visible[0]
    assert seen.sum() >= 48
    off = track.position_px[0] - rolling
    assert np.abs(off[seen] - np.median(off[seen], axis=0)).max() < 2 * SPREAD_PX


def test_what_only_its_colour_shows_in_half_of_the_film_is_followed_through_all_of_it():
    """A green ball before a wall that is darker on the left and as bright on the right."""
    bright = np.interp(np.arange(SIZE_PX[1]), [0, 160, 319], [40, 128, 128])
    wall = np.repeat(np.tile(bright, (SIZE_PX[0], 1))[..., None], 3, axis=2)
    path = np.stack([20 + 9.0 * np.arange(31), 80 + 0.0 * np.arange(31)], axis=1)
    frames = []
    for at, rng in zip(path, np.random.default_rng(0).spawn(31), strict=True):
        frame = np.round(wall + rng.normal(0, 2.0, wall.shape[:2])[..., None]).astype(np.uint8)
        cv2.circle(frame, tuple(map(int, at)), 9, (40, 170, 80), -1, cv2.LINE_AA)
        frames.append(frame)
    track = tracked(frames, path[0])
    seen = track.is_visible[0]
    assert seen.mean() > 0.9
    assert np.hypot(*(track.position_px[0] - path)[seen].T).max() < 1.5


def test_a_moving_camera_has_no_silhouettes():
    places = [np.array([[30.0 + 4 * i, 60.0]]) for i in range(20)]
    frames = [picture(at, camera=9.0 * i, contrast=70, seed=i) for i, at in enumerate(places)]
    paths = paths_of(lambda: iter(frames), np.arange(20.0))
    assert all(len(path.frames) < 5 for path in paths)


def fits_along(place: np.ndarray) -> list[Refined | None]:
    return [
        None if np.isnan(at[0]) else Refined(np.array([*at, 0.0]), 1e-4 * np.eye(2), 0.99, 0.0, 0.0)
        for at in place
    ]


@pytest.mark.parametrize("is_thrown_back", [False, True])
def test_after_a_gap_counts_what_the_path_before_leads_to(is_thrown_back):
    time = np.arange(60.0)
    place = np.stack([10 + 3 * time, 200 - 4 * time + 0.1 * time**2], axis=1)
    if is_thrown_back:
        place[40:, 0] = place[32, 0] - 3 * (time[40:] - 32)
    place[25:40] = np.nan
    (found,) = finished([fits_along(place)], [Whole()], [0.0], Coding(np.zeros(60, bool)), time)
    seen = np.isfinite(found.angle_rad)
    assert seen[:25].all()
    assert seen[40:].all() != is_thrown_back
    assert seen[40:].any() != is_thrown_back


def released(is_led: bool = True) -> tuple[Finished, Path, np.ndarray]:
    """Held until frame 20, then its texture goes astray, and its silhouette parts from the hand's.

    The followed point is 6 px beside the silhouette's middle.
    """
    rng = np.random.default_rng(0)
    time = np.arange(50.0)
    middle = np.stack([100 + 0.6 * np.maximum(time - 20, 0) ** 2, np.full(50, 80.0)], axis=1)
    texture = middle + [6.0, 0.0] + 0.05 * rng.standard_normal((50, 2))
    texture[28:32, 0] += [-9, 5, -14, 2]
    texture[32:] = np.nan
    none = np.where(np.isfinite(texture[:, 0]), 0.0, np.nan)
    square = none[:, None, None] + np.zeros((50, 2, 2))
    found = Finished(texture, square + 1e-2 * np.eye(2), square, square, none)
    places = middle[33:] + 0.1 * rng.standard_normal((17, 2)) + [0.0, 0.0 if is_led else 25.0]
    parts = [Part(at, 18.0**2, at - 9, at + 9) for at in places]
    return found, Path(list(range(33, 50)), list(time[33:]), parts), middle


def test_texture_and_silhouette_are_one_path_where_it_leads_from_one_to_the_other():
    """The frames in which a hand holds it are kept, how far they are apart stays unknown.

    That is one error, the same in all frames of those in which it goes less far. As one of its
    flight that comes and goes, 5 px of it would hide the air's drag.
    """
    found, path, middle = released()
    start = Start("ball", (106.0, 80.0), Outline(None))
    track = with_silhouette(found, start, [path], np.arange(50.0))
    seen = np.isfinite(track.angle_rad)
    assert seen[:28].all() and not seen[28:33].any() and seen[33:].all()
    assert np.abs(track.position_px[seen] - middle[seen]).max() < 2.0
    own = (ON_OBJECT * 18.0) ** 2 * np.eye(2)
    np.testing.assert_allclose(track.common_px2[:28], np.tile(own, (28, 1, 1)))
    np.testing.assert_array_equal(track.common_px2[33:], 0.0)
    assert (track.covariance_px2[:28, 0, 0] > own[0, 0]).all()
    assert (track.shifts_px[33:, 0, 0] < 1.0).all() and (track.shifts_px[:28] == 0).all()


def test_a_silhouette_to_which_no_path_leads_is_followed_alone():
    found, path, _ = released(is_led=False)
    start = Start("ball", (106.0, 80.0), Outline(None))
    track = with_silhouette(found, start, [path], np.arange(50.0))
    assert (np.flatnonzero(np.isfinite(track.angle_rad)) == path.frames).all()


def test_a_silhouette_that_goes_to_and_fro_about_the_texture_is_no_better_known_than_that():
    time = np.arange(50.0)
    middle = np.stack([20 + 0.1 * time**2, np.full(50, 40.0)], axis=1)
    texture = np.where(time[:, None] < 35, middle, np.nan)
    path = Path([], [], [])
    for index, place in enumerate(middle + 3.0 * np.sin(time[:, None] / 4)):
        path.append(index, float(index), Part(place, 400.0, place - 10, place + 10))
    none = np.where(np.isfinite(texture[:, 0]), 0.0, np.nan)
    square = none[:, None, None] + np.zeros((50, 2, 2))
    found = Finished(texture, square + 1e-3 * np.eye(2), square, square, none)
    start = Start("ball", (20.0, 40.0), Outline((20.0, 20.0)))
    track = with_silhouette(found, start, [path], time)
    assert np.isfinite(track.angle_rad).all()
    assert (track.shifts_px[:, 0, 0] > 2.0).all(), "rms of what it is off by: 2.1 px"


def test_a_texture_that_goes_round_does_not_make_the_silhouette_uncertain():
    """A ball that turns in the air: 8 px, of which all are the texture's."""
    time = np.arange(50.0)
    middle = np.stack([20 + 8 * time, 400 - 14 * time + 0.2 * time**2], axis=1)
    round_it = 8.0 * np.stack([np.cos(0.2 * time), np.sin(0.2 * time)], axis=1)
    texture = np.where(time[:, None] < 42, middle + round_it, np.nan)
    path, rng = Path([], [], []), np.random.default_rng(2)
    for index, place in enumerate(middle + 0.2 * rng.standard_normal(middle.shape)):
        path.append(index, float(index), Part(place, 900.0, place - 15, place + 15))
    none = np.where(np.isfinite(texture[:, 0]), 0.0, np.nan)
    square = none[:, None, None] + np.zeros((50, 2, 2))
    found = Finished(texture, square + 1e-3 * np.eye(2), square, square, none)
    start = Start("ball", (28.0, 400.0), Outline((30.0, 30.0)))
    track = with_silhouette(found, start, [path], time)
    assert np.isfinite(track.angle_rad).all()
    assert (track.shifts_px[:, 0, 0] < 1.0).all()
    off = track.position_px - middle
    np.testing.assert_allclose(off, np.broadcast_to(off.mean(axis=0), off.shape), atol=1.0)


def test_a_mark_that_goes_round_tells_the_middle():
    """Its path is as smooth as the silhouette's, whose scatter is larger."""
    time = np.arange(50.0)
    angle, middle = 0.004 * time**2, np.stack([20 + 0.1 * time**2, 40 + 0.02 * time**2], axis=1)
    mark = middle + 3.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    seen = middle + np.random.default_rng(3).normal(0, 0.15, middle.shape) + [0.4, 0.0]
    path = Path([], [], [])
    for index, place in enumerate(seen):
        path.append(index, float(index), Part(place, 400.0, place - 10, place + 10))
    square = np.zeros((50, 2, 2))
    found = Finished(mark, square + 1e-3 * np.eye(2), square, np.zeros((50, 6, 2, 2)), angle)
    start = Start("disc", (23.0, 40.0), Outline((22.0, 22.0), is_round=True))
    track = with_silhouette(found, start, [path], time)
    off = track.position_px - middle
    np.testing.assert_allclose(off, np.broadcast_to(off.mean(axis=0), off.shape), atol=0.12)


@pytest.mark.parametrize("thread_px", [1, 2])
def test_the_thread_that_a_ball_hangs_on_is_not_the_ball(thread_px: int) -> None:
    angle = 0.25 * np.cos(np.arange(40) / 6)
    path = np.stack([80 + 220 * np.sin(angle), 60 + 220 * np.cos(angle)], axis=1)

    def hung(shown: np.ndarray, at: np.ndarray) -> np.ndarray:
        ends = [
            tuple(np.round(np.multiply(16, one)).astype(int).tolist()) for one in ((80, 60), at)
        ]
        return cv2.line(shown.copy(), ends[0], ends[1], 60, thread_px, cv2.LINE_AA, 4)

    shown = [hung(one, at) for one, at in zip(film(path), path, strict=True)]
    found = max(paths_of(lambda: iter(shown), np.arange(40.0)), key=lambda one: one.way_px)
    assert len(found.frames) > 25
    off = np.hypot(*(found.places_px - path[found.frames]).T)
    assert off.max() < 2 * RADIUS_PX and np.median(off) < RADIUS_PX / 4


def test_of_a_texture_that_is_lost_at_once_the_mark_tells_whose_silhouette_it_is():
    """A ball that flies twice its size a frame: two places, the second of something else."""
    time = np.arange(30.0)
    middle = np.stack([100 + 14 * time, 240 - 32 * time + 1.1 * time**2], axis=1)
    path, rng = Path([], [], []), np.random.default_rng(2)
    for index, place in enumerate(middle + 0.1 * rng.standard_normal(middle.shape)):
        path.append(index, float(index), Part(place, 196.0, place - 7, place + 7))
    texture = np.full((30, 2), np.nan)
    texture[1:3] = middle[1], middle[1] - [35.0, 1.0]
    none = np.where(np.isfinite(texture[:, 0]), 0.0, np.nan)
    square = none[:, None, None] + np.zeros((30, 2, 2))
    found = Finished(texture, square + 1e-3 * np.eye(2), square, square, none)
    outline = Outline((15.0, 15.0), is_round=True)
    track = with_silhouette(found, Start("ball", (101.0, 241.0), outline), [path], time)
    assert np.isfinite(track.angle_rad).all()
    assert np.abs(track.position_px - middle).max() < 0.5
    assert (track.shifts_px[:, 0, 0] < 1.0).all() and (track.common_px2 == 0).all()
    beside = with_silhouette(found, Start("ball", (160.0, 241.0), outline), [path], time)
    assert np.isfinite(beside.angle_rad).sum() == 2

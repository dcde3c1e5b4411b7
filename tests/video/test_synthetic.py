from dataclasses import replace
from itertools import pairwise

import cv2
import numpy as np
import pytest

from galileo_jax.video.synthetic import (
    Body,
    Camera,
    Filming,
    Hand,
    Motion,
    Ramp,
    render_frames,
    write_clip,
)
from galileo_jax.video.synthetic.filming import project

pytestmark = pytest.mark.video

CAMERA = Camera(400.0, (100.0, 140.0), (240, 180))
BOX = Body((0.08, 0.06))
STILL = Filming(noise_grey_levels=0.0, flicker=0.0, exposure_s=0.0)
SUBPIXEL_PX = 0.015  # about half of it is the least squares' own error
CODEC_RMS_PX = 0.05


def still(x: float, y: float, pitch: float = 0.0) -> Motion:
    return Motion(np.array([0.0, 1.0]), np.array([[[x, x], [y, y]]]), np.array([[pitch, pitch]]))


def moving(velocity: tuple[float, float], spin: float = 0.0) -> Motion:
    times = np.linspace(0, 1, 101)
    path = np.array([[0.03 + velocity[0] * times, 0.10 + velocity[1] * times]])
    return Motion(times, path, spin * times[None])


def pictures(motion: Motion, filming: Filming = STILL, num_frames: int = 1, **changed):
    given = {"bodies": (BOX,), "camera": CAMERA, "ramp": None, "seed": 1} | changed
    seed = given.pop("seed")
    frames = render_frames(motion, filming=filming, num_frames=num_frames, seed=seed, **given)
    return np.array([frame.picture for frame in frames]).astype(float)


def inside(motion: Motion, time_s: float, camera: Camera = CAMERA) -> tuple[slice, slice]:
    """Rows and columns well inside the box."""
    column, row = camera.project(motion.at(time_s)[0][0])
    half = 0.02 * camera.pixels_per_metre
    return (
        slice(int(row - half), int(row + half) + 1),
        slice(int(column - half), int(column + half) + 1),
    )


def shift_px(reference: np.ndarray, picture: np.ndarray, window) -> np.ndarray:
    """How far `picture` is moved against `reference` in a window: (x, y), least squares.

    On brightness alone, as trackers do; the codec stores colours at half the resolution.
    """
    smooth = [
        cv2.GaussianBlur(image @ [0.114, 0.587, 0.299], (0, 0), 2.0)
        for image in (reference, picture)
    ]
    middle = (smooth[0] + smooth[1]) / 2
    # Fourth order: plain central differences see a fine texture 5 % too flat.
    stencil = np.array([[1.0, -8.0, 0.0, 8.0, -1.0]]) / 12
    slope_x = cv2.filter2D(middle, -1, stencil)
    slope_y = cv2.filter2D(middle, -1, stencil.T)
    design = np.stack([slope_x[window].ravel(), slope_y[window].ravel()], axis=-1)
    difference = (smooth[0] - smooth[1])[window].ravel()
    return np.linalg.lstsq(design, difference, rcond=None)[0]


@pytest.mark.parametrize("moved_px", [(0.25, 0.0), (0.37, -0.18), (0.0, 0.5)])
def test_texture_moves_by_fractions_of_a_pixel(moved_px):
    start = still(0.1, 0.1)
    end = still(0.1 + moved_px[0] / 400, 0.1 - moved_px[1] / 400)
    found = shift_px(pictures(start)[0], pictures(end)[0], inside(start, 0))
    assert found == pytest.approx(moved_px, abs=SUBPIXEL_PX)


def test_body_is_where_and_turned_as_the_truth_says():
    # Half a turn about the projected centre maps the pixels round it onto each other.
    column, row = CAMERA.project(np.array([0.1, 0.1]))
    assert (column, row) == (140.0, 100.0)
    window = slice(92, 109), slice(132, 149)
    upright, turned = (pictures(still(0.1, 0.1, pitch))[0][window] for pitch in (0.0, np.pi))
    assert upright.std() > 10
    assert np.abs(upright - turned[::-1, ::-1]).max() <= 2


def test_positive_pitch_is_counter_clockwise():
    level, tilted = (pictures(still(0.1, 0.1, pitch))[0] for pitch in (0.0, 0.2))
    column, row = 140, 100
    turn = cv2.getRotationMatrix2D((column, row), np.degrees(0.2), 1.0)  # positive: ditto
    expected = cv2.warpAffine(level, turn, CAMERA.size_px)
    window = slice(row - 6, row + 7), slice(column - 6, column + 7)
    wrong = cv2.warpAffine(level, cv2.invertAffineTransform(turn), CAMERA.size_px)
    error, error_if_wrong = (np.abs(image - tilted)[window].mean() for image in (expected, wrong))
    assert error < 0.25 * error_if_wrong


def test_motion_blur_is_the_mean_over_the_exposure():
    motion = moving((0.6, -0.1), spin=1.0)
    exposure_s = 0.03
    blurred = pictures(motion, replace(STILL, fps=5.0, exposure_s=exposure_s), 2)[1]
    instants = 0.2 + exposure_s * ((np.arange(30) + 0.5) / 30 - 0.5)
    sharp = np.mean([pictures(motion_from(motion, t))[0] for t in instants], axis=0)
    assert np.abs(blurred - pictures(motion_from(motion, 0.2))[0]).max() > 30
    assert np.abs(blurred - sharp).max() < 3


def motion_from(motion: Motion, time_s: float) -> Motion:
    return replace(motion, times_s=motion.times_s - time_s)


def test_noise_and_flicker_are_as_large_as_declared():
    quiet = pictures(still(0.1, 0.1))[0]
    noisy = pictures(still(0.1, 0.1), replace(STILL, noise_grey_levels=5.0), 3)
    assert (noisy - quiet).std() == pytest.approx(5.0, rel=0.02)
    assert np.corrcoef((noisy[0] - quiet).ravel(), (noisy[1] - quiet).ravel())[0, 1] < 0.02
    flickering = pictures(still(0.1, 0.1), replace(STILL, flicker=0.01), 100)
    assert flickering.mean(axis=(1, 2, 3)).std() / quiet.mean() == pytest.approx(0.01, rel=0.3)


def test_same_seed_same_frames_and_other_noise_same_things():
    first, again, other = (pictures(still(0.1, 0.1), Filming(), 2, seed=seed) for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert np.abs(first - other).mean() > 10
    assert np.abs(first[0] - pictures(still(0.1, 0.1), seed=4)[0]).mean() < 5


def test_missed_frames_show_the_one_before_again():
    shown = pictures(moving((0.3, 0)), replace(Filming(), repeated_frames=(2, 3)), 6)
    is_same = [np.array_equal(a, b) for a, b in pairwise(shown)]
    assert is_same == [False, True, True, False, False]


def test_defocus_blurs():
    sharp, soft = (pictures(still(0.1, 0.1), replace(STILL, defocus_px=sd))[0] for sd in (0.0, 2.0))
    assert soft == pytest.approx(cv2.GaussianBlur(sharp, (0, 0), 2.0), abs=1.5)


def test_hand_covers_object_1_only_at_the_start():
    filming = replace(STILL, hand=Hand(leave_s=0.1, offset_m=(0.0, 0.0)))
    frames = list(render_frames(still(0.1, 0.1), (BOX,), CAMERA, None, filming, 15, seed=1))
    covered = np.array([frame.covered[0] for frame in frames])
    assert covered[:3] == pytest.approx(covered[0])
    assert 0.05 < covered[0] < 0.9
    assert np.all(np.diff(covered[3:]) <= 0)
    assert covered[-1] == 0
    without = pictures(still(0.1, 0.1))[0]
    assert np.abs(frames[0].picture - without).max() > 20
    assert np.abs(pictures(still(0.1, 0.1), filming, 30)[-1] - without).max() == 0


def test_camera_maps_metres_to_pixels():
    assert CAMERA.project(np.array([[0, 0], [0.1, 0.2]])).tolist() == [[100, 140], [140, 60]]
    mirrored = replace(CAMERA, direction="left")
    assert mirrored.project(np.array([0.1, 0.2])).tolist() == [60, 60]
    askew = replace(CAMERA, keystone_per_m=(0.05, -0.02))
    assert askew.project(np.zeros(2)).tolist() == [100, 140]
    near_origin = askew.project(np.array([[1e-6, 0.0], [0.0, 1e-6]])) - [100, 140]
    assert near_origin / 1e-6 == pytest.approx(np.diag([400, -400]), rel=1e-3, abs=1e-3)
    there = askew.project(np.array([0.1, 0.2]))
    assert there[0] == pytest.approx(100 + 400 * 0.1 / (1 + 0.05 * 0.1 - 0.02 * 0.2))
    assert project(np.linalg.inv(askew.world_to_image), there) == pytest.approx([0.1, 0.2])


def test_object_under_a_tilted_camera_is_where_the_homography_says():
    askew = replace(CAMERA, keystone_per_m=(0.3, 0.2))
    start, end = still(0.1, 0.1), still(0.101, 0.1)
    before, after = askew.project(np.array([[0.1, 0.1], [0.101, 0.1]]))
    found = shift_px(
        pictures(start, camera=askew)[0], pictures(end, camera=askew)[0], inside(start, 0, askew)
    )
    assert found == pytest.approx(after - before, abs=2 * SUBPIXEL_PX)


@pytest.mark.parametrize(
    ("body", "share"),
    [
        (BOX, 1.0),
        (Body((0.06, 0.05)), 1.0),
        (Body((0.06, 0.06), is_round=True), np.pi / 4),
        (Body((0.16, 0.04), is_round=True), 1 - (1 - np.pi / 4) / 4),
    ],
    ids=lambda value: getattr(value, "shape", ""),
)
def test_each_shape_is_drawn_to_size(body, share):
    width, height = body.outline_m
    # The wall alone is had by moving the object out of the picture.
    wall = pictures(still(9, 9), bodies=(body,))[0]
    changed = np.abs(pictures(still(0.1, 0.1), bodies=(body,))[0] - wall).max(axis=-1) > 2
    assert changed.sum() == pytest.approx(share * width * height * 400**2, rel=0.12)
    columns = np.flatnonzero(changed.any(axis=0))
    assert columns[-1] - columns[0] + 1 == pytest.approx(400 * width, abs=2)


def test_ramp_and_table_meet_at_the_origin():
    bare, ramped = (
        pictures(still(9, 9), ramp=ramp)[0] for ramp in (None, Ramp(np.radians(30), 0.2))
    )
    changed = np.abs(bare - ramped).max(axis=-1) > 4
    top = 140 - 400 * 0.2 * np.sin(np.radians(30))
    left = 100 - 400 * 0.2 * np.cos(np.radians(30))
    rows, columns = np.nonzero(changed)
    assert rows.min() == pytest.approx(top, abs=2)
    assert rows.max() == pytest.approx(140, abs=2)
    assert columns.min() == pytest.approx(left, abs=2)
    assert columns.max() == pytest.approx(100, abs=4)


def test_codec_moves_things_by_less_than_its_share_of_the_tracking_bar(tmp_path):
    motion = moving((0.30, -0.02))
    filming = replace(STILL, exposure_s=0.008, noise_grey_levels=4.0)
    exact = pictures(motion, replace(filming, noise_grey_levels=0.0), 25)
    path = tmp_path / "clip.mp4"
    film = render_frames(motion, (BOX,), CAMERA, None, filming, 25, seed=1)
    write_clip(path, film, CAMERA, filming)
    video = cv2.VideoCapture(str(path))
    decoded = [frame for ok, frame in iter(video.read, (False, None)) if ok]
    assert len(decoded) == 25
    errors = [
        shift_px(exact[i], decoded[i].astype(float), inside(motion, i / 30)) for i in range(25)
    ]
    assert np.sqrt(np.mean(np.square(errors))) < CODEC_RMS_PX


def test_nothing_is_left_of_a_clip_that_was_stopped(tmp_path):
    def stop():
        raise KeyboardInterrupt

    film = render_frames(still(0.1, 0.1), (BOX,), CAMERA, None, STILL, 3, seed=1)
    with pytest.raises(KeyboardInterrupt):
        write_clip(tmp_path / "clip.mp4", film, CAMERA, STILL, stop)
    assert list(tmp_path.iterdir()) == []

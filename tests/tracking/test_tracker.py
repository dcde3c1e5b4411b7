"""Whole tracks of filmed boxes with exactly known paths."""

import numpy as np
import pytest

from galileo_jax.tracking.exposure import Exposure
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.template import Outline, grey, template_at
from galileo_jax.tracking.tracker import Start, track_video
from tests.tracking.moving_box import Box, Plain, Ringed, film, slide

pytestmark = pytest.mark.video

BOX = Box()
FPS = 30.0


def tracked(frames, *poses, box=BOX, first_frame=0):
    starts = [
        Start(f"object{k + 1}", (pose[0], pose[1]), Outline(box.size_px), first_frame)
        for k, pose in enumerate(poses)
    ]
    return track_video(lambda: iter(frames), starts, np.arange(len(frames)) / FPS)


def errors(track, path, k=0):
    return track.position_px[k] - path[:, :2]


@pytest.mark.parametrize("share", [0.0, 0.4])
def test_slide_with_a_turn_at_the_foot(share):
    path = slide()
    track = tracked(film([(BOX, path)], share=share), path[0])
    assert track.is_visible.all()
    error = errors(track, path)
    # Two of forty frames hold a blow inside the exposure.
    assert np.sqrt((error**2).sum(axis=1).mean()) < (0.15 if share else 0.04)
    assert np.median(np.linalg.norm(error, axis=1)) < 0.03
    turn = np.median(np.abs(track.angle_rad[0] - path[:, 2]))
    assert turn < np.radians(0.2)
    inverse = np.linalg.inv(track.covariance_px2[0])
    nse = np.einsum("ni,nij,nj->n", error, inverse, error)[1:] / 2
    # The first frame's own error is in every point: 2 is expected where only noise errs.
    assert 0.3 < np.mean(nse) < 4, nse.round(1)


def test_exposure_is_learned_from_the_smear():
    path = np.stack([30 + 6.0 * np.arange(20), np.full(20, 50.0), np.zeros(20)], axis=1)
    frames = film([(BOX, path)], share=0.5)
    sharp = film([(BOX, path[:1])])[0]
    template = template_at(grey(sharp), path[0, :2], Outline(BOX.size_px))
    exposure = Exposure()
    for index in range(3, 15):
        exposure.add(Picture(grey(frames[index])), template, path[index], np.array([6.0, 0.0, 0.0]))
    # Seven instants from end to end spread a little wider than an even exposure.
    assert exposure.share == pytest.approx(0.5 * 8 / 7, abs=0.08)


def test_covered_object_is_a_gap_and_found_again():
    path = slide(frames=30, turn_at=30)
    path[:, 0] = 60 + 0.8 * np.arange(30)
    frames = film([(BOX, path)])
    for index in range(12, 18):
        frames[index][10:110, 20:160] = 150  # a hand, all over it
    track = tracked(frames, path[0])
    assert not track.is_visible[0, 12:18].any()
    assert track.is_visible[0, :12].all()
    assert track.is_visible[0, 18:].all()
    assert np.isnan(track.position_px[0, 12:18]).all()
    assert np.nanmax(np.abs(errors(track, path))) < 0.08


def test_object_at_rest_that_was_covered_long_is_seen_again_to_the_last_frame():
    path = np.tile([60.3, 60.6, 0.0], (26, 1))
    frames = film([(BOX, path)])
    for index in range(4, 20):
        frames[index][10:110, 20:160] = 150
    track = tracked(frames, path[0])
    assert not track.is_visible[0, 4:20].any()
    assert track.is_visible[0, 21:].all()
    assert np.nanmax(np.abs(errors(track, path))) < 0.08


def test_repeated_frame_is_a_gap_and_not_a_stop():
    path = slide(frames=22, turn_at=30)
    frames = film([(BOX, path)])
    frames[15] = frames[14]
    track = tracked(frames, path[0])
    assert np.flatnonzero(~track.is_visible[0]).tolist() == [15]
    assert np.nanmax(np.abs(errors(track, path))) < 0.08


def test_object_that_leaves_the_picture_leaves_no_points():
    time = np.arange(40)
    path = np.stack([150 + 0.2 * time**2, np.full(40, 60.0), np.zeros(40)], axis=1)
    track = tracked(film([(BOX, path)]), path[0])
    is_out = path[:, 0] > 240 + 20
    assert not track.is_visible[0, is_out].any()
    assert track.is_visible[0, path[:, 0] < 215].all()
    assert np.nanmax(np.abs(errors(track, path))) < 0.3


def test_two_objects_that_touch_are_kept_apart():
    other = Box(seed=4)
    time = np.arange(40)
    first = np.stack([40 + 3.0 * np.minimum(time, 20), np.full(40, 60.0), 0 * time], axis=1)
    first[20:, 0] += 1.5 * (time[20:] - 20)
    second = np.stack([np.full(40, 132.0), np.full(40, 60.0), 0 * time], axis=1)
    second[20:, 0] += 1.5 * (time[20:] - 20)
    track = tracked(film([(BOX, first), (other, second)]), first[0], second[0])
    assert track.is_visible.all()
    for k, path in enumerate((first, second)):
        assert np.abs(errors(track, path, k)).max() < 0.08


def test_point_beside_the_centre_turns_with_the_object():
    path = slide()
    point = path[0, :2] + (6.0, 3.0)
    track = tracked(film([(BOX, path)]), point)
    c, s = np.cos(path[:, 2]), np.sin(path[:, 2])
    expected = path[:, :2] + np.stack([6 * c - 3 * s, 6 * s + 3 * c], axis=1)
    # The region reaches past the box on one side, over the background.
    assert np.median(np.linalg.norm(track.position_px[0] - expected, axis=1)) < 0.1


def test_a_ring_does_not_turn_by_itself_where_it_is_smeared():
    """Marked on a ring, whose letters hardly show how it turns: less so, smeared along its way."""
    box = Ringed()
    way = slide()
    path = np.concatenate([np.repeat(way[:1], 12, axis=0), way, np.repeat(way[-1:], 12, axis=0)])
    off = np.array(box.ring_px) + np.array([1.5, 1.0]) - np.array(box.size_px) / 2
    frames = film([(box, path)], share=0.5, size_px=(320, 130))
    start = Start("tin", tuple(path[0, :2] + off), Outline(None))
    track = track_video(lambda: iter(frames), [start], np.arange(len(frames)) / FPS)
    assert track.is_visible.all()
    assert np.abs(track.angle_rad[0] - path[:, 2])[[*range(30), *range(50, len(path))]].max() < 0.05
    c, s = np.cos(path[:, 2]), np.sin(path[:, 2])
    arm = np.stack([c * off[0] - s * off[1], s * off[0] + c * off[1]], axis=1)
    assert np.median(np.linalg.norm(errors(track, path + np.c_[arm, 0 * c]), axis=1)) < 0.2


def test_frames_before_the_first_are_not_visible():
    path = slide(frames=20)
    track = tracked(film([(BOX, path)]), path[5], first_frame=5)
    assert not track.is_visible[0, :5].any()
    assert track.is_visible[0, 5:].all()


def test_plain_disc_is_followed_without_a_turn():
    frames, path = [], []
    rng = np.random.default_rng(2)
    for index in range(14):
        y, x = np.mgrid[:140, :400]
        place = (30 + 26.0 * index, 20 + 0.55 * (index - 7) ** 2 + 0.3)
        ball = 100 * (1 - np.tanh(np.hypot(x - place[0], y - place[1]) - 6))
        frames.append(np.clip(20 + ball + rng.normal(0, 2, ball.shape), 0, 255).astype(np.uint8))
        path.append((*place, 0.0))
    path = np.array(path)
    start = Start("ball", (path[0, 0], path[0, 1]), Outline(None))
    track = track_video(lambda: iter(frames), [start], np.arange(len(frames)) / FPS)
    assert track.is_visible.all()
    assert np.abs(errors(track, path)).max() < 0.1
    assert np.abs(track.angle_rad).max() < 1e-5


@pytest.mark.parametrize("off_px", [(0, 0), (4, -2), (-5, 1), (2, 2)])
def test_wherever_a_plain_box_is_marked_it_is_followed(off_px):
    """Around a point in its middle there is nothing to see."""
    n = np.arange(20)
    path = np.stack([40 + 0.35 * n**2, 40 + 0.1 * n**2, 0.0 * n], axis=1)
    place = path[0, :2] + off_px
    track = track_video(
        lambda: iter(film([(Plain(), path)])),
        [Start("box", (float(place[0]), float(place[1])), Outline(None))],
        n / FPS,
    )
    assert track.is_visible.all()
    assert np.abs(errors(track, path) - off_px).max() < 1.0


def struck(frames=16, speed=14.0, after=3.0, hit=7):
    """A box that moves from the first frame on, and is braked by a blow."""
    time = np.arange(frames, dtype=float)
    x = 40.3 + speed * np.minimum(time, hit) + after * np.maximum(time - hit, 0)
    return np.stack([x, np.full(frames, 60.4), 0.05 * time], axis=1)


def test_a_box_that_is_smeared_in_its_first_frame_is_followed_past_a_blow():
    path, other = struck(), Box(seed=4)
    flies = np.stack(
        [180.0 + 10.0 * np.maximum(np.arange(16.0) - 7, 0), np.full(16, 60.7), np.zeros(16)], axis=1
    )
    frames = film([(BOX, path), (other, flies)], share=0.8, size_px=(320, 120))
    track = tracked(frames, path[0], flies[0])
    assert track.is_visible.all()
    assert np.abs(errors(track, path)).max() < 0.5


def test_an_object_that_vanishes_is_not_taken_for_its_twin_beside_it():
    time = np.arange(24, dtype=float)
    first = np.stack([40.3 + 6.0 * time, np.full(24, 60.4), 0 * time], axis=1)
    second = np.tile([139.6, 60.7, 0.0], (24, 1))
    frames = film([(BOX, first), (BOX, second)])
    frames[10:] = film([(BOX, second)])[10:]
    track = tracked(frames, first[0], second[0])
    assert track.is_visible[1].all()
    assert track.is_visible[0, :10].all()
    assert not track.is_visible[0, 10:].any()

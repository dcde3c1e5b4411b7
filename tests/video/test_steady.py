"""A camera that moves: what stands still tells how, and pictures are drawn as if it had rested."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from galileo_jax.video import steady
from galileo_jax.video.decode import frames, probe
from galileo_jax.video.synthetic import Body, Camera, Filming, Motion, Ramp, render_frames
from galileo_jax.video.synthetic.filming import sway, turned_camera
from tests.video.make_video import write_film

WIDTH, HEIGHT, FOCAL_PX = 480, 270, 600.0
COUNT = 24


def scene(seed: int = 0) -> np.ndarray:
    """A wall with soft clouds, a table and a slope, larger than what a camera sees of it."""
    rng = np.random.default_rng(seed)
    clouds = rng.uniform(90, 170, (22, 36)).astype(np.float32)
    wall = cv2.resize(clouds, (WIDTH + 240, HEIGHT + 160), interpolation=cv2.INTER_CUBIC)
    cv2.rectangle(wall, (0, 330), (WIDTH + 240, 336), 60.0, -1)
    cv2.line(wall, (60, 140), (420, 330), 40.0, 4, cv2.LINE_AA)
    return wall


def turned(pan: float, tilt: float, roll: float) -> np.ndarray:
    """From where a camera at rest sees a place to where one does that is turned, rad."""
    middle = np.array([[FOCAL_PX, 0, WIDTH / 2], [0, FOCAL_PX, HEIGHT / 2], [0, 0, 1]])
    turn, _ = cv2.Rodrigues(np.array([tilt, pan, roll]))
    return middle @ turn @ np.linalg.inv(middle)


def from_hand(seed: int = 1, size: float = 8e-3) -> list[np.ndarray]:
    """Homographies of a camera in a hand, the first at rest."""
    rng = np.random.default_rng(seed)
    way = np.cumsum(rng.normal(size=(COUNT, 3)), axis=0)
    way = size * (way - way[0]) / np.abs(way - way[0]).max()
    return [turned(*one) for one in way * (1, 1, 0.5)]


def filmed(camera: list[np.ndarray], box_px: int = 24, noise: float = 2.0) -> list[np.ndarray]:
    """Grey pictures of the scene, in which a box slides to the right."""
    rng, wall = np.random.default_rng(7), scene()
    texture = rng.integers(0, 255, (box_px // 6, box_px // 6)).astype(np.float32)
    box = cv2.resize(texture, (box_px, box_px), interpolation=cv2.INTER_NEAREST)
    aside = np.array([[1, 0, -120.0], [0, 1, -80.0], [0, 0, 1]])
    pictures = []
    for number, one in enumerate(camera):
        there = wall.copy()
        x, y = 150 + number**2 // 3, 318 - box_px
        there[y : y + box_px, x : x + box_px] = box
        seen = cv2.warpPerspective(there, one @ aside, (WIDTH, HEIGHT), flags=cv2.INTER_CUBIC)
        pictures.append(np.clip(seen + rng.normal(0, noise, seen.shape), 0, 255).astype(np.uint8))
    return pictures


def off_px(found: list, camera: list[np.ndarray]) -> float:
    """By how much the places of pictures are off in the first, at most."""
    both = steady.displacements_px(np.array(found) @ np.array(camera), SHAPE)
    return float(np.abs(both).max())


SHAPE = (HEIGHT, WIDTH)


def test_a_hand_is_followed_to_a_tenth_of_a_pixel():
    camera = from_hand()
    found = list(steady.to_first(filmed(camera)))
    assert np.abs(steady.displacements_px(np.array(camera), SHAPE)).max() > 4
    assert off_px(found, camera) < steady.TOLD_PX  # at the corners
    middle = np.array([WIDTH / 2, HEIGHT / 2, 1])
    for one, own in zip(found, camera, strict=True):
        there = one @ own @ middle
        assert np.abs(there[:2] / there[2] - middle[:2]).max() < 0.1


def test_a_pan_is_followed_while_half_of_the_first_picture_is_seen():
    camera = [turned(-0.6 * n / COUNT, 0.0, 0.0) for n in range(COUNT)]
    way = [-steady.displacements_px(one[None], SHAPE)[0, :, 0].mean() / WIDTH for one in camera]
    found = list(steady.to_first(filmed(camera)))
    middle = np.array([WIDTH / 2, HEIGHT / 2, 1])
    for one, own, share in zip(found, camera, way, strict=True):
        if abs(share) < 0.4:
            there = one @ own @ middle
            assert np.abs(there[:2] / there[2] - middle[:2]).max() < 0.5
        elif abs(share) > 0.55:
            assert one is None
    assert abs(way[-1]) > 0.55


def test_a_camera_that_opens_up_is_followed():
    """Automatic exposure: brighter by a third in the end, and flatter by a fifth."""
    camera, pictures = from_hand(), filmed(from_hand())
    share = np.linspace(0, 1, COUNT)[:, None, None]
    lit = (1 - 0.2 * share) * np.array(pictures) + 40 * share
    found = list(steady.to_first(np.clip(lit, 0, 255).astype(np.uint8)))
    assert off_px(found, camera) < steady.TOLD_PX


@pytest.mark.parametrize("shape", [(640, 360), (360, 640), (500, 500)])
def test_a_picture_of_noise_is_looked_at_whichever_way_it_is_held(shape: tuple[int, int]):
    """Each pixel is steep there, and OpenCV reads 2^15 places at once at most."""
    rng = np.random.default_rng(0)
    pictures = list(rng.integers(0, 255, (2, *shape)).astype(np.uint8))
    assert len(list(steady.to_first([pictures[0], pictures[0]]))) == 2
    assert list(steady.to_first(pictures))[1] is None


def glimpsed(pictures: list[np.ndarray]) -> bool:
    glimpses = steady.Glimpses()
    for picture in pictures:
        glimpses.add(picture)
    return glimpses.camera_moves(np.ones(len(pictures), bool))


@pytest.mark.parametrize("box_px", [24, 96])
def test_what_slides_is_no_camera(box_px):
    still = [np.eye(3)] * COUNT
    assert not glimpsed(filmed(still, box_px))
    assert glimpsed(filmed(from_hand(), box_px))


def test_in_front_of_a_plain_wall_nothing_tells():
    pictures = []
    for number in range(COUNT):
        picture = np.full((HEIGHT, WIDTH), 120, np.uint8)
        picture[100:140, 50 + 9 * number : 90 + 9 * number] = np.arange(40) * 6
        pictures.append(picture)
    assert all(one is None for one in list(steady.to_first(pictures))[1:])
    assert not glimpsed(pictures)


def coloured(pictures: list[np.ndarray]) -> Iterator[np.ndarray]:
    return (cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR) for picture in pictures)


def kept(path: Path, pictures: list[np.ndarray]) -> Path:
    """A film that shows them to the last bit."""
    return write_film(path, coloured(pictures), codec="ffv1", pix_fmt="bgr0")


@pytest.mark.video
def test_pictures_are_drawn_as_if_the_camera_had_rested(tmp_path: Path):
    path = kept(tmp_path / "hand.mkv", filmed(from_hand(), noise=0.0))
    inner, rest = np.s_[20:-20, 20:-20], filmed([np.eye(3)] * COUNT, noise=0.0)
    off = [
        float(cv2.absdiff(drawn[..., 0], expected)[inner].mean())
        for drawn, expected in zip(frames(path), rest, strict=True)
    ]
    assert max(off) < 1.0
    (said,) = probe(path).warnings
    assert "the camera moves by up to 6 px" in said and "drawn as if it had rested" in said


@pytest.mark.video
def test_pictures_of_a_camera_at_rest_are_left_as_they_are(tmp_path: Path):
    pictures = filmed([np.eye(3)] * COUNT)
    path = kept(tmp_path / "rest.mkv", pictures)
    for drawn, picture in zip(frames(path), pictures, strict=True):
        np.testing.assert_array_equal(drawn[..., 0], picture)
    assert probe(path).warnings == ()


@pytest.mark.video
def test_a_rendered_hand_is_undone():
    motion = Motion(
        np.array([0.0, 1.0]), np.array([[[0.1, 0.6], [0.025, 0.025]]]), np.zeros((1, 2))
    )
    camera, filming = Camera(400.0, (60.0, 200.0), (400, 240)), Filming(sway_rad=4e-3)
    ramp = Ramp(0.3, 0.2)
    box = (Body((0.06, 0.05)),)
    made = render_frames(motion, box, camera, ramp, filming, COUNT, seed=1)
    seen = [cv2.cvtColor(frame.picture, cv2.COLOR_BGR2GRAY) for frame in made]
    turns = sway(filming, COUNT, np.random.default_rng([1, 2]))
    assert np.abs(turns).max() > 4e-3 and not turns[0].any()
    for one, turn in zip(steady.to_first(seen), turns, strict=True):
        both = one @ turned_camera(turn, camera.size_px)
        assert np.abs(steady.displacements_px(both[None], (240, 400))[0, 12]).max() < 0.15


@pytest.mark.video
def test_where_a_camera_cannot_be_followed_pictures_are_left_out(tmp_path: Path):
    pictures = filmed(from_hand())
    pictures[13] = np.random.default_rng(3).integers(0, 255, SHAPE).astype(np.uint8)
    path = write_film(tmp_path / "flash.mp4", coloured(pictures))
    found = probe(path)
    moves, lost = [line for line in found.warnings if "camera" in line]
    assert "the camera moves by up to" in moves
    assert "in picture 13 the camera has moved" in lost and "left out" in lost
    assert found.frame_count == COUNT - 1 == len(list(frames(path)))

import os
import tracemalloc
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from galileo_jax.runtime.errors import InputError
from galileo_jax.video import decode
from galileo_jax.video.decode import frames, probe
from galileo_jax.video.weave import first_field, rows_of
from tests.video.make_video import (
    with_index_first,
    with_uneven_frames,
    write_film,
    write_video,
)

pytestmark = pytest.mark.video


@pytest.fixture(scope="module")
def video(tmp_path_factory) -> Path:
    return write_video(tmp_path_factory.mktemp("video") / "clip.mp4")


def test_probe_counts_by_decoding(video: Path) -> None:
    info = probe(video)
    assert info.frame_count == 24
    assert info.size_px == (320, 180)
    assert info.fps == info.container_fps == 30.0
    assert info.warnings == ()


def test_frames_are_bgr_in_order(video: Path) -> None:
    seen = list(frames(video))
    assert len(seen) == 24
    assert all(frame.shape == (180, 320, 3) and frame.dtype == np.uint8 for frame in seen)
    # The square moves one pixel per frame on grey ground.
    left = [int((np.abs(frame[92].astype(int) - 128).sum(axis=1) > 60).argmax()) for frame in seen]
    assert np.allclose(left, 20 + np.arange(24), atol=2)


def test_whole_frames_are_told_from_predicted_ones(video: Path, tmp_path: Path) -> None:
    whole = np.flatnonzero(~decode.predicted_from_before(video))
    np.testing.assert_array_equal(whole, [0, 12])  # as often as OpenCV's MPEG-4 has them
    # MJPEG codes every frame for itself.
    assert not decode.predicted_from_before(write_video(tmp_path / "clip.avi")).any()


def test_frames_predicted_from_both_sides_do_not_count(
    video: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scan = decode._scan(video)
    for kinds, expected in (
        ("IPPBPP", "011001"),
        ("IBBPP", "00001"),
        ("??", "11"),
        ("I??", "011"),
    ):
        count = len(kinds)
        there = replace(
            scan, kinds=kinds, change=scan.change[:count], contrast=scan.contrast[:count]
        )
        monkeypatch.setattr(decode, "_scan", lambda _, there=there: there)
        found = decode.predicted_from_before(video)
        assert "".join("1" if one else "0" for one in found) == expected


def test_a_longer_film_takes_no_more_memory(tmp_path: Path) -> None:
    def peak(frame_count: int) -> int:
        path = write_video(tmp_path / f"{frame_count}.mp4", frame_count=frame_count)
        tracemalloc.start()
        for _ in frames(path):
            pass
        _, found = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return found

    frame_bytes = 320 * 180 * 3
    assert peak(250) < peak(125) + 2 * frame_bytes


def test_frames_keep_one_frame_in_memory(tmp_path: Path) -> None:
    path = write_video(tmp_path / "long.mp4", frame_count=150)
    probe(path)
    frame_bytes = 320 * 180 * 3
    tracemalloc.start()
    for _ in frames(path):
        pass
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 4 * frame_bytes


@pytest.mark.parametrize("declared, num_warnings", [(30.0, 0), (30.2, 0), (240.0, 1), (29.0, 1)])
def test_declared_frame_rate_wins(video: Path, declared: float, num_warnings: int) -> None:
    info = probe(video, declared)
    assert info.fps == declared
    assert len(info.warnings) == num_warnings


def test_index_first_is_the_same_video(video: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(with_index_first(video.read_bytes()))
    assert probe(path).frame_count == 24


@pytest.mark.parametrize("num_lost", [1, 2])
def test_one_or_two_missing_frames_are_a_warning(num_lost: int, video: Path, monkeypatch) -> None:
    scan = replace(decode._scan(video), missing=num_lost)
    monkeypatch.setattr(decode, "_scan", lambda _: scan)
    assert f"24 of {24 + num_lost} announced" in probe(video).warnings[0]


def test_cut_off_video_names_both_counts(video: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    content = with_index_first(video.read_bytes())
    path.write_bytes(content[: int(0.6 * len(content))])
    with pytest.raises(InputError, match=r"clip\.mp4: cut off or damaged: only \d+ of 24 frames"):
        probe(path)


def test_pictures_have_their_own_times(video: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(with_uneven_frames(video.read_bytes()))
    info = probe(path)
    steps = [1 / 60] * 12 + [1 / 20] * 11
    np.testing.assert_allclose(np.diff(info.times_s), steps, atol=1e-4)
    assert info.warnings == ()


def disc_at(x: float, y: float, size_px: tuple[int, int] = (160, 96)) -> np.ndarray:
    """A smooth dark disc of 20 px on light ground."""
    column, row = np.meshgrid(np.arange(size_px[0]), np.arange(size_px[1]))
    inside = np.clip(10.5 - np.hypot(column - x, row - y), 0, 1)[..., None]
    return (200 - inside * np.array([150, 110, 170])).astype(np.uint8)


def middle_of(picture: np.ndarray) -> np.ndarray:
    """Where the disc is, (x, y)."""
    dark = 200.0 - picture[..., 1]
    dark[dark < 30] = 0
    row, column = np.indices(dark.shape)
    return np.array([(dark * column).sum(), (dark * row).sum()]) / dark.sum()


MOVING = [disc_at(30 + 4 * index, 48) for index in range(24)]


@pytest.mark.parametrize(
    ("name", "codec", "pix_fmt"),
    [
        ("clip.mp4", "libx264", "yuv420p"),
        ("clip.mp4", "libx265", "yuv420p10le"),
        ("clip.mp4", "libsvtav1", "yuv420p"),
        ("clip.mkv", "ffv1", "yuv420p"),
        ("clip.webm", "libvpx-vp9", "yuv420p"),
        ("clip.gif", "gif", "rgb8"),
        ("clip.mpg", "mpeg2video", "yuv420p"),
        ("clip.avi", "libx264", "yuv420p"),  # whose stamps are in the order of coding
        ("clip.avi", "mpeg4", "yuv420p"),
        ("clip.mov", "mjpeg", "yuvj420p"),
    ],
)
def test_films_of_many_kinds(name: str, codec: str, pix_fmt: str, tmp_path: Path) -> None:
    path = write_film(tmp_path / name, MOVING, codec=codec, pix_fmt=pix_fmt, fps=25)
    info = probe(path)
    np.testing.assert_allclose(info.times_s, np.arange(24) / 25, atol=1e-6)
    assert info.fps == pytest.approx(25)
    places = np.array([middle_of(picture) for picture in frames(path)])
    np.testing.assert_allclose(places[:, 0], 30 + 4 * np.arange(24), atol=1.0)


def test_pixels_are_made_square(tmp_path: Path) -> None:
    def wide(stream: Any) -> None:
        stream.codec_context.sample_aspect_ratio = Fraction(16, 11)

    path = write_film(tmp_path / "clip.mp4", MOVING, set_up=wide)
    info = probe(path)
    assert info.size_px == (233, 96)
    assert "pixels are 1.455 times as wide as high" in info.warnings[0]
    x = [middle_of(picture)[0] for picture in frames(path)]
    # The middle of pixel x is at 16/11 (x + 1/2) - 1/2.
    np.testing.assert_allclose(x, 233 / 160 * (30.5 + 4 * np.arange(24)) - 0.5, atol=0.3)
    assert not decode.predicted_from_before(path).any()


def test_pictures_are_turned_upright(tmp_path: Path) -> None:
    path = write_film(
        tmp_path / "clip.mp4", MOVING, set_up=lambda stream: stream.set_display_rotation(90)
    )
    assert probe(path).size_px == (96, 160)
    first = next(frames(path))
    capture = cv2.VideoCapture(str(path))  # which turns them, too
    np.testing.assert_array_equal(first, capture.read()[1])


def test_what_an_edit_list_hides_is_not_there(tmp_path: Path) -> None:
    path = write_film(tmp_path / "clip.mp4", MOVING, options={"bf": "0"}, hidden=7)
    info = probe(path)
    assert (info.frame_count, info.warnings) == (17, ())
    assert middle_of(next(frames(path)))[0] == pytest.approx(30 + 4 * 7, abs=0.5)


def test_the_pattern_of_a_palette_is_no_comb_of_fields() -> None:
    """Bayer's pattern, which a GIF lays over all of its picture, is the same two rows apart."""
    pattern = 16 * np.indices((120, 480))[0] % 32
    pictures = [(disc_at(30 + 5 * n, 60, (480, 120))[..., 0] // 32 * 32 + pattern).astype(np.uint8)
                for n in range(7)]  # fmt: skip
    assert first_field(np.sum([rows_of(*pair) for pair in pairwise(pictures)], axis=0)) is None


@pytest.mark.parametrize("first", ["tff", "bff"])
@pytest.mark.parametrize("step_px", [3, 20, 30])
def test_the_first_field_shows_however_far_things_go(first: str, step_px: int) -> None:
    """By as many as three of the ball's radii from field to field."""
    rng, pictures = np.random.default_rng(2), []
    for index in range(0, 14, 2):
        one, other = (disc_at(30 + step_px * k, 60, (480, 120)) for k in (index, index + 1))
        woven = (one if first == "tff" else other)[..., 0].copy()
        woven[1::2] = (other if first == "tff" else one)[1::2, :, 0]
        pictures.append((woven + rng.normal(0, 2, woven.shape)).clip(0, 255).astype(np.uint8))
    rows = np.sum([rows_of(*pair) for pair in pairwise(pictures)], axis=0)
    assert first_field(rows) == first


@pytest.mark.parametrize("is_said", [True, False])
@pytest.mark.parametrize("first", ["tff", "bff"])
def test_fields_have_their_own_times(first: str, is_said: bool, tmp_path: Path) -> None:
    """Whether the file says that its pictures are woven or not."""
    fields = [disc_at(20 + 2 * index, 48) for index in range(48)]
    woven = []
    for one, other in zip(fields[::2], fields[1::2], strict=True):
        upper, lower = (one, other) if first == "tff" else (other, one)
        woven.append(upper.copy())
        woven[-1][1::2] = lower[1::2]
    path = write_film(
        tmp_path / "clip.mp4", woven, fps=25,
        options={"x264-params": f"{first}=1:crf=10", "flags": "+ilme+ildct"}
        if is_said else {"crf": "10"},
    )  # fmt: skip
    info = probe(path, 25.0)
    np.testing.assert_allclose(info.times_s, np.arange(48) / 50, atol=1e-6)
    assert "interlaced" in info.warnings[0]
    places = np.array([middle_of(picture) for picture in frames(path)])
    np.testing.assert_allclose(places[2:-2, 0], 20 + 2 * np.arange(2, 46), atol=0.6)
    np.testing.assert_allclose(places[2:-2, 1], 48, atol=0.6)


def test_whole_pictures_in_an_interlaced_file_stay_whole(tmp_path: Path) -> None:
    path = write_film(
        tmp_path / "clip.mp4", MOVING,
        options={"x264-params": "tff=1", "flags": "+ilme+ildct"},
    )  # fmt: skip
    assert probe(path).frame_count == 24


def test_repeated_pictures_are_left_out(tmp_path: Path) -> None:
    thrice = [picture for picture in MOVING for _ in range(3)]
    path = write_film(tmp_path / "clip.mp4", thrice, fps=75)
    info = probe(path, 75.0)
    np.testing.assert_allclose(info.times_s, np.arange(24) / 25, atol=1e-6)
    assert "48 of 72 pictures repeat the one before, each is there 3 times" in info.warnings[0]
    x = [middle_of(picture)[0] for picture in frames(path)]
    np.testing.assert_allclose(x, 30 + 4 * np.arange(24), atol=0.5)


def test_black_and_faded_pictures_at_the_ends_are_left_out(tmp_path: Path) -> None:
    black = np.zeros_like(MOVING[0])
    faded = (MOVING[1] * 0.3).astype(np.uint8)
    path = write_film(tmp_path / "clip.mp4", [black, faded, *MOVING[2:23], black])
    info = probe(path)
    assert info.frame_count == 21
    assert "picture 0, 1, 23 are black, blank or faded" in info.warnings[0]
    assert info.times_s[0] == 0
    assert middle_of(next(frames(path)))[0] == pytest.approx(38, abs=0.5)


def test_only_the_last_stamp_may_be_missing(video: Path, monkeypatch) -> None:
    scan = decode._scan(video)
    for last in (np.nan, 0.0):
        stamps = np.append(scan.stamps_s[:-1], last)
        monkeypatch.setattr(decode, "_scan", lambda _, s=stamps: replace(scan, stamps_s=s))
        np.testing.assert_allclose(probe(video).times_s, np.arange(24) / 30)
    stamps = scan.stamps_s.copy()
    stamps[5] = stamps[4]
    monkeypatch.setattr(decode, "_scan", lambda _: replace(scan, stamps_s=stamps))
    with pytest.raises(InputError, match=r"time stamps: pictures 5 are not later"):
        probe(video)
    stamps = np.where(np.arange(24) == 7, np.nan, scan.stamps_s)
    monkeypatch.setattr(decode, "_scan", lambda _: replace(scan, stamps_s=stamps))
    with pytest.raises(InputError, match=r"time stamps: pictures 7 have no time stamp"):
        probe(video)


@pytest.mark.parametrize(
    "content, message",
    [
        (None, "no such file"),
        (b"", "empty file"),
        (b"hello", "cannot be decoded"),
    ],
)
def test_what_is_no_video(content: bytes | None, message: str, tmp_path: Path, capfd) -> None:
    path = tmp_path / "clip.mp4"
    if content is not None:
        path.write_bytes(content)
    for reading in (probe, lambda path: next(frames(path))):
        with pytest.raises(InputError, match=f"clip.mp4: {message}"):
            reading(path)
    assert capfd.readouterr().err == ""


def test_unreadable_file(video: Path, tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(video.read_bytes())
    path.chmod(0)
    if os.access(path, os.R_OK):  # as root, who may read everything
        monkeypatch.setattr(os, "access", lambda *_: False)
    with pytest.raises(InputError, match="permissions"):
        probe(path)

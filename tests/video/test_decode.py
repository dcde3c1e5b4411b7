import os
import tracemalloc
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from cv2 import VideoCapture

from galileo_jax.runtime.errors import InputError
from galileo_jax.video import decode
from galileo_jax.video.decode import frames, probe
from tests.video.make_video import with_index_first, with_uneven_frames, write_video

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
    scan = decode._scan(video)  # pyright: ignore[reportPrivateUsage]
    for kinds, expected in (
        ("IPPBPP", "011001"),
        ("IBBPP", "00001"),
        ("\0\0", "11"),
        ("I??", "011"),
    ):
        there = replace(scan, kinds=tuple(map(ord, kinds)))
        monkeypatch.setattr(decode, "_scan", lambda _, there=there: there)
        found = decode.predicted_from_before(video)
        assert "".join("1" if one else "0" for one in found) == expected


def test_frames_keep_one_frame_in_memory(tmp_path: Path) -> None:
    path = write_video(tmp_path / "long.mp4", frame_count=150)
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


class MiscountedVideo:
    """A capture that ends early; no subclass, which crashes in OpenCV's destructor."""

    def __init__(self, num_frames: int, *arguments) -> None:
        self.capture = VideoCapture(*arguments)
        self.left = num_frames

    def grab(self) -> bool:
        self.left -= 1
        return self.left >= 0 and self.capture.grab()

    def __getattr__(self, name: str):
        return getattr(self.capture, name)


@pytest.mark.parametrize("num_lost", [1, 2])
def test_one_or_two_missing_frames_are_a_warning(num_lost: int, video: Path, monkeypatch) -> None:
    monkeypatch.setattr(decode.cv2, "VideoCapture", partial(MiscountedVideo, 24 - num_lost))
    decode._scanned.cache_clear()  # other tests have looked at this video
    info = probe(video)
    assert info.frame_count == 24 - num_lost
    decode._scanned.cache_clear()
    assert f"{24 - num_lost} of 24" in info.warnings[0]


def test_cut_off_video_names_both_counts(video: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    content = with_index_first(video.read_bytes())
    path.write_bytes(content[: int(0.6 * len(content))])
    with pytest.raises(InputError, match=r"clip\.mp4: cut off or damaged: only \d+ of 24 frames"):
        probe(path)


def test_uneven_frames_are_refused(video: Path, tmp_path: Path) -> None:
    path = tmp_path / "clip.mp4"
    path.write_bytes(with_uneven_frames(video.read_bytes()))
    with pytest.raises(InputError, match=r"variable frame rate: frames are 16\.67 to 50 ms apart"):
        probe(path)


@pytest.mark.parametrize("fps", [15.1515, 29.97, 240.0])
@pytest.mark.parametrize("tick_ms", [1.0, 1000 / 600])
def test_rounded_timestamps_are_even(fps: float, tick_ms: float) -> None:
    exact_ms = 1000 / fps * np.arange(300)
    decode._check_even_spacing(Path("x"), np.round(exact_ms / tick_ms) * tick_ms)


@pytest.mark.parametrize("lost", [1, 30, 150, 298])
def test_one_lost_frame_is_found_anywhere(lost: int) -> None:
    times_ms = np.delete(1000 / 30 * np.arange(300), lost)
    with pytest.raises(InputError, match=f"worst after frame {lost - 1}"):
        decode._check_even_spacing(Path("x"), times_ms)


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

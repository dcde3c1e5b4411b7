"""Decoding a video as a stream: one frame in memory at a time."""

import functools
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from galileo_jax.runtime.errors import InputError

# OpenCV's and FFmpeg's own lines on stderr would bury ours; the variables bring them back.
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # read when the first video is opened
if "OPENCV_LOG_LEVEL" not in os.environ:
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)

MIN_FRAMES = 4
"""With fewer frames there is no change of speed to see; also tells a picture from a video."""

MAX_TIMESTAMP_ERROR = 0.25
"""Largest distance of a timestamp from an even grid, in frames. One lost frame gives 0.5 or
more; a container that rounds to 1 ms or to 1/600 s gives at most 0.2 at 240 fps."""

MAX_MISSING_SHARE = 0.02
"""Frames announced but not decodable that are only warned of: containers miscount by one or two."""


UNKNOWN_KINDS = (0, ord("?"))
"""What OpenCV gives for the kind of a frame where the file does not say."""


@dataclass(frozen=True)
class VideoInfo:
    """What decoding a whole video showed.

    Attributes:
      frame_count: frames that decode (not what the header says).
      size_px: (width, height).
      fps: the declared frame rate, or the container's where none was declared.
      container_fps: what the container says; 0 if it says nothing.
      warnings: doubts, one line each.
    """

    frame_count: int
    size_px: tuple[int, int]
    fps: float
    container_fps: float
    warnings: tuple[str, ...] = ()


def frames(path: Path) -> Iterator[np.ndarray]:
    """Yields the frames of a video one by one, `[height, width, 3]` uint8, BGR.

    Raises `InputError` for a missing or undecodable file. A file that breaks off ends the
    iteration; `probe` is what tells it from a whole one.

    Limits: OpenCV scales frames whose size changes midway to the first frame's size.
    """
    with _opened(path) as capture:
        while True:
            is_read, frame = capture.read()
            if not is_read:
                return
            yield frame


def probe(path: Path, fps_declared: float | None = None) -> VideoInfo:
    """Decodes the whole video once and says what it is.

    Keeps one frame and eight bytes per frame (its timestamp). A declared frame rate that
    contradicts the container's is only warned of: high-speed clips often say 29.97.

    Raises `InputError` if the file is missing, empty, no video, a picture, or cut off; or if
    its frames are unevenly spaced, because then frame number / fps is not the time.
    """
    scan = _scan(path)
    announced, container_fps, size_px = scan.announced, scan.container_fps, scan.size_px
    count = len(scan.times_ms)
    if count == 0:
        raise InputError(f"{path}: not one frame can be decoded; a video expected")
    if count < MIN_FRAMES:
        raise InputError(
            f"{path}: only {count} frame(s); a video of at least {MIN_FRAMES} frames expected"
        )

    warnings = []
    missing = int(announced) - count
    if missing > max(2, MAX_MISSING_SHARE * announced):
        raise InputError(
            f"{path}: cut off or damaged: only {count} of {int(announced)} frames can be decoded; "
            "copy it again, or re-encode what is there"
        )
    if missing > 0:
        warnings.append(f"{path}: {count} of {int(announced)} announced frames can be decoded")
    _check_even_spacing(path, np.array(scan.times_ms))

    fps = fps_declared or container_fps
    if fps <= 0:
        raise InputError(f"{path}: the container states no frame rate; declare fps")
    if container_fps > 0 and abs(fps / container_fps - 1) > 0.01:
        warnings.append(
            f"{path}: fps: {fps:g} declared, the container says {container_fps:.4g}; "
            f"{fps:g} is used"
        )
    return VideoInfo(count, size_px, fps, container_fps, tuple(warnings))


def predicted_from_before(path: Path) -> np.ndarray:
    """`[frame]`, bool: whether a frame was coded as what changes since the frame before it.

    Not so are whole frames (I), frames that are predicted from both sides (B), and those that
    follow them. Where a file does not say, frames count as predicted.

    Raises `InputError` as `frames`.
    """
    kinds = np.array(
        [chr(kind) if kind not in UNKNOWN_KINDS else "P" for kind in _scan(path).kinds]
    )
    is_predicted = kinds == "P"
    is_predicted[1:] &= kinds[:-1] != "B"
    return is_predicted


@contextmanager
def _opened(path: Path) -> Iterator[cv2.VideoCapture]:
    path = Path(path)
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        raise InputError(f"{path}: not a file; a video expected")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path}: cannot be read (permissions)")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: empty file (0 bytes); a video expected")
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    try:
        if not capture.isOpened():
            raise InputError(
                f"{path}: cannot be decoded: not a video, without frames, or cut off before "
                "its index"
            )
        yield capture
    finally:
        capture.release()


@dataclass(frozen=True)
class _Scan:
    """Frames announced, the container's rate, the frames' size, times (ms) and kinds."""

    announced: float
    container_fps: float
    size_px: tuple[int, int]
    times_ms: tuple[float, ...]
    kinds: tuple[int, ...]  # the letter's code


def _scan(path: Path) -> _Scan:
    found = path.stat() if path.is_file() else None
    stamp = (found.st_mtime_ns, found.st_size, found.st_ino) if found is not None else ()
    return _scanned(path, path.resolve(), *stamp)


@functools.lru_cache(64)
def _scanned(path: Path, _whole: Path, *_stamp: int) -> _Scan:
    """Once for each content: who draws marks has the clip checked at every step."""
    times_ms: list[float] = []
    kinds: list[int] = []
    with _opened(path) as capture:
        announced = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        container_fps = max(capture.get(cv2.CAP_PROP_FPS), 0.0)
        size_px = (0, 0)
        while capture.grab():
            if not times_ms:
                is_decoded, frame = capture.retrieve()
                if not is_decoded:
                    break
                size_px = (frame.shape[1], frame.shape[0])
            times_ms.append(capture.get(cv2.CAP_PROP_POS_MSEC))
            kinds.append(int(capture.get(cv2.CAP_PROP_FRAME_TYPE)))
    return _Scan(announced, container_fps, size_px, tuple(times_ms), tuple(kinds))


def _check_even_spacing(path: Path, times_ms: np.ndarray) -> None:
    """Compares the timestamps with the straight line through them."""
    index = np.arange(len(times_ms))
    interval_ms, start_ms = np.polyfit(index, times_ms, 1)
    if interval_ms <= 0:
        return  # no timestamps in this format: nothing to check
    error = np.abs(times_ms - (start_ms + interval_ms * index)) / interval_ms
    if error.max() <= MAX_TIMESTAMP_ERROR:
        return
    intervals = np.diff(times_ms)
    worst = int(np.argmax(np.abs(intervals - np.median(intervals))))
    raise InputError(
        f"{path}: variable frame rate: frames are {intervals.min():.4g} to "
        f"{intervals.max():.4g} ms apart (worst after frame {worst}), so frame number / fps is "
        "not the time; record at a constant rate, or cut to an evenly spaced part"
    )

"""Frames of a video: enough of them, small enough, to be carried by a page."""

import base64
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np

BUDGET_BYTES = 2_500_000  # of all pictures, before base64
LARGEST_PX = 720
MOST_PICTURES = 120
QUALITIES = (80, 65, 50, 35)


@dataclass(frozen=True)
class VideoFrames:
    """Evenly spaced frames of a video.

    Attributes:
      frames: their numbers.
      pictures: JPEGs, as data URIs.
      size_px: (width, height) of the pictures.
    """

    frames: tuple[int, ...]
    pictures: tuple[str, ...]
    size_px: tuple[int, int]


def sample_frames(video: Path, num_frames: int) -> VideoFrames:
    """At most 120 evenly spaced ones of the first `num_frames` frames, some 2.5 MB in all.

    The first picture decides how much the JPEGs are compressed, so that one frame is in memory
    at a time.
    """
    stride = -(-num_frames // MOST_PICTURES)
    wanted = range(0, num_frames, stride)
    from galileo_jax.video import decode

    share = BUDGET_BYTES / len(wanted)
    frames, pictures, quality, size = [], [], 0, (0, 0)
    for index, frame in enumerate(decode.frames(video)):
        if index >= num_frames:
            break
        if index % stride:
            continue
        if not size[0]:
            size = _size(frame)
            quality = next(
                (q for q in QUALITIES if len(_jpeg(frame, size, q)) <= share), QUALITIES[-1]
            )
        frames.append(index)
        encoded = base64.b64encode(_jpeg(frame, size, quality)).decode("ascii")
        pictures.append(f"data:image/jpeg;base64,{encoded}")
    return VideoFrames(tuple(frames), tuple(pictures), size)


def first_and_last_frame(video: Path) -> list[np.ndarray]:
    """The two frames, `[height, width, 3]`, RGB; one where there are no more."""
    from galileo_jax.video import decode

    stream = decode.frames(video)
    first = next(stream)
    return [frame[..., ::-1] for frame in (first, *deque(stream, maxlen=1))]


def _size(frame: np.ndarray) -> tuple[int, int]:
    height, width = frame.shape[:2]
    smaller = min(1.0, LARGEST_PX / max(height, width))
    return round(width * smaller), round(height * smaller)


def _jpeg(frame: np.ndarray, size: tuple[int, int], quality: int) -> bytes:
    import cv2

    small = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()

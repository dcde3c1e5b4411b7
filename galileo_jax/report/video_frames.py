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
            size = smaller_size(frame, LARGEST_PX)
            quality = next(
                (q for q in QUALITIES if len(jpeg(frame, LARGEST_PX, q)) <= share), QUALITIES[-1]
            )
        frames.append(index)
        encoded = base64.b64encode(jpeg(frame, LARGEST_PX, quality)).decode("ascii")
        pictures.append(f"data:image/jpeg;base64,{encoded}")
    return VideoFrames(tuple(frames), tuple(pictures), size)


def first_and_last_frame(video: Path) -> list[np.ndarray]:
    """The two frames, `[height, width, 3]`, RGB; one where there are no more."""
    from galileo_jax.video import decode

    stream = decode.frames(video)
    first = next(stream)
    return [frame[..., ::-1] for frame in (first, *deque(stream, maxlen=1))]


def smaller_size(frame: np.ndarray, largest_px: int) -> tuple[int, int]:
    """(width, height) of a frame whose longer side has at most so many pixels."""
    height, width = frame.shape[:2]
    smaller = min(1.0, largest_px / max(height, width))
    return max(1, round(width * smaller)), max(1, round(height * smaller))


def jpeg(frame: np.ndarray, largest_px: int, quality: int) -> bytes:
    """A frame as JPEG, of that size at most."""
    import cv2

    small = cv2.resize(frame, smaller_size(frame, largest_px), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()

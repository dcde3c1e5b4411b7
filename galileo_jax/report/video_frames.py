"""Frames of a video: enough of them, small enough, to be carried by a page."""

import base64
from collections import deque
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np

BUDGET_BYTES = 2_500_000  # of all pictures, before base64
LARGEST_PX = 720
MOST_PICTURES = 120
QUALITIES = (80, 65, 50, 35)


@dataclass(frozen=True)
class VideoFrames:
    """Evenly spaced frames of a video."""

    frames: tuple[int, ...]
    pictures: tuple[str, ...]  # JPEGs, as data URIs
    size_px: tuple[int, int]  # (width, height) of the pictures


def sample_frames(video: Path, num_frames: int) -> VideoFrames:
    """At most 120 evenly spaced ones of the first `num_frames` frames, some 2.5 MB in all.

    The first picture decides how much the JPEGs are compressed, so that one frame is in memory
    at a time.
    """
    from galileo_jax.video import decode

    wanted = range(0, num_frames, -(-num_frames // MOST_PICTURES))
    share = BUDGET_BYTES / len(wanted)
    pictures, quality, size = [], 0, (0, 0)
    for frame in islice(decode.frames(video), 0, num_frames, wanted.step):
        if not pictures:
            size = smaller_size(frame, LARGEST_PX)
            fitting = (q for q in QUALITIES if len(jpeg(frame, LARGEST_PX, q)) <= share)
            quality = next(fitting, QUALITIES[-1])
        pictures.append(data_uri("jpeg", jpeg(frame, LARGEST_PX, quality)))
    return VideoFrames(tuple(wanted[: len(pictures)]), tuple(pictures), size)


def data_uri(kind: str, picture: bytes) -> str:
    """A picture as a page carries it; `kind`: "jpeg", "png"."""
    return f"data:image/{kind};base64,{base64.b64encode(picture).decode('ascii')}"


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

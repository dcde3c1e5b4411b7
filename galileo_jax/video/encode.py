"""Films as mp4 files (MPEG-4 part 2)."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2

from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError


@contextmanager
def writing_mp4(path: Path, fps: float, size_px: tuple[int, int]) -> Iterator[cv2.VideoWriter]:
    """What takes pictures of a size (width, height); the film is there whole or not at all.

    Raises `InputError` where OpenCV cannot write one.
    """
    with replacing(path) as temporary:
        codec = cv2.VideoWriter.fourcc(*"mp4v")
        writer = cv2.VideoWriter(str(temporary), codec, fps, size_px)
        if not writer.isOpened():
            raise InputError(f"{path}: cannot be written: OpenCV has no mp4 encoder here")
        try:
            yield writer
        finally:
            writer.release()

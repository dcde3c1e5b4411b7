"""The frames of a video as pictures: decoded once in order, then there for every jump."""

import tempfile
import threading
from functools import lru_cache
from pathlib import Path

from galileo_jax.report.video_frames import jpeg
from galileo_jax.video import decode

LARGEST_PX = 1280
QUALITY = 85
PATIENCE_S = 10.0  # for a frame to be decoded
MOST_HELD = 4  # videos


class Frames:
    """One video's frames as JPEGs on disk, in a folder that ends with the server."""

    def __init__(self, video: Path):
        self._video = video
        self._folder = tempfile.TemporaryDirectory(prefix="galileo_studio_")
        self._ready = 0
        self._is_over = False
        self._changed = threading.Condition()
        threading.Thread(target=self._decode, daemon=True).start()

    def picture(self, index: int) -> bytes | None:
        """The JPEG of a frame; None beyond the end, or where it cannot be decoded in time."""
        with self._changed:
            self._changed.wait_for(lambda: self._ready > index or self._is_over, PATIENCE_S)
            if not 0 <= index < self._ready:
                return None
        return self._path(index).read_bytes()

    def _decode(self) -> None:
        try:
            for index, frame in enumerate(decode.frames(self._video)):
                self._path(index).write_bytes(jpeg(frame, LARGEST_PX, QUALITY))
                with self._changed:
                    self._ready = index + 1
                    self._changed.notify_all()
        finally:
            with self._changed:
                self._is_over = True
                self._changed.notify_all()

    def _path(self, index: int) -> Path:
        return Path(self._folder.name) / f"{index:06d}.jpg"


@lru_cache(MOST_HELD)
def frames_of(video: Path) -> Frames:
    """The frames of a video, of which the last few that were looked at are held."""
    return Frames(video)

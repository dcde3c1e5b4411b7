"""The track drawn over the video, to check by eye."""

import itertools
from collections.abc import Callable, Iterable
from pathlib import Path

import cv2
import numpy as np

from galileo_jax.runtime.atomic_write import replacing
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.pose import rotation
from galileo_jax.tracking.track import Track
from galileo_jax.video.encode import writing_mp4

COLOURS = ((40, 40, 255), (255, 160, 0), (0, 200, 0), (220, 0, 220))  # BGR, by object
OUTLINE = (255, 255, 255)
SUBPIXEL_BITS = 4  # OpenCV draws at multiples of 1/16 px
MARK_PX = 9.0
SMALLEST_PX = 960  # smaller pictures are enlarged to about this width, so that a pixel can be seen


def write_overlay_video(
    path: Path,
    frames: Iterable[np.ndarray],
    track: Track,
    *,
    advance: Callable[[], None] = lambda: None,
) -> None:
    """Writes the frames with each object's place, turn and path so far (mp4, real time)."""
    fps = 1 / float(np.median(np.diff(track.times_s)))
    scale = _enlargement(track)
    width, height = track.frame_size_px
    with writing_mp4(path, fps, (scale * width, scale * height)) as writer:
        for index, frame in enumerate(frames):
            writer.write(drawn(frame, track, index, scale))
            advance()


def write_overlay_picture(path: Path, frames: Iterable[np.ndarray], track: Track) -> None:
    """Writes the first frame with the whole paths and each object's last seen place (png)."""
    first = next(iter(frames))
    picture = drawn(first, track, len(track.times_s) - 1, _enlargement(track))
    with replacing(path) as temporary:
        if not cv2.imwrite(str(temporary), picture):
            raise InputError(f"{path}: cannot be written")


def drawn(frame: np.ndarray, track: Track, index: int, scale: int) -> np.ndarray:
    """`frame`, enlarged, with the paths up to frame `index` and the objects as last seen."""
    picture = cv2.resize(frame, None, fx=scale, fy=scale, interpolation=cv2.INTER_CUBIC)
    if picture.ndim == 2:
        picture = cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    for k, name in enumerate(track.names):
        colour = COLOURS[k % len(COLOURS)]
        # The middle of pixel (x, y) lies at scale (x + 1/2) - 1/2 in the enlarged picture.
        places = scale * (track.position_px[k, : index + 1] + 0.5) - 0.5
        seen = np.flatnonzero(track.is_visible[k, : index + 1])
        if not len(seen):
            continue
        for a, b in itertools.pairwise(seen):
            if b == a + 1:  # no line across a gap
                _line(picture, places[a], places[b], colour)
        last = seen[-1]
        for arm in MARK_PX * rotation(track.angle_rad[k, last]).T:
            _line(picture, places[last] - arm, places[last] + arm, OUTLINE)
        label = name if last == index else f"{name} (not seen)"
        corner = tuple(int(v) for v in places[last] + (12, -12))
        for shade, width in ((0, 0, 0), 3), (colour, 1):
            cv2.putText(
                picture, label, corner, cv2.FONT_HERSHEY_SIMPLEX, 0.45, shade, width, cv2.LINE_AA
            )
    return picture


def _enlargement(track: Track) -> int:
    return max(1, round(SMALLEST_PX / track.frame_size_px[0]))


def _line(picture: np.ndarray, start: np.ndarray, end: np.ndarray, colour) -> None:
    a, b = (tuple(round(float(v) * 2**SUBPIXEL_BITS) for v in point) for point in (start, end))
    cv2.line(picture, a, b, colour, 1, cv2.LINE_AA, SUBPIXEL_BITS)

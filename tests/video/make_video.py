"""Small videos for the tests, and the ways in which a video can be broken."""

import struct
from collections.abc import Callable, Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np

SIZE_PX = (320, 180)


def write_film(
    path: Path,
    pictures: Iterable[np.ndarray],
    *,
    codec: str = "libx264",
    pix_fmt: str = "yuv420p",
    fps: int = 30,
    ticks: Sequence[int] | None = None,
    tick_s: Fraction = Fraction(1, 90_000),
    options: Mapping[str, str] | None = None,
    set_up: Callable[[Any], None] = lambda _: None,
    hidden: int = 0,
) -> Path:
    """A film of BGR pictures of any kind; by default H.264.

    Args:
      path: the suffix says the container.
      pictures: `[height, width, 3]` uint8.
      codec: FFmpeg's name.
      pix_fmt: of the coded pictures.
      fps: pictures per second.
      ticks: when each is shown, in units of `tick_s`; None: evenly.
      tick_s: the clock's.
      options: the codec's.
      set_up: is given the stream before the first picture.
      hidden: pictures at the beginning that an edit list hides.
    """
    with av.open(str(path), "w", options={"avoid_negative_ts": "disabled"}) as container:
        stream: Any = container.add_stream(codec, rate=fps, options=dict(options or {}))
        if ticks is not None:
            stream.codec_context.time_base = tick_s

        def mux(packets: Iterable[Any]) -> None:
            for packet in packets:
                if hidden:
                    early = int(hidden / (fps * packet.time_base))
                    packet.pts, packet.dts = packet.pts - early, packet.dts - early
                container.mux(packet)

        for index, picture in enumerate(pictures):
            if index == 0:
                stream.height, stream.width = picture.shape[:2]
                stream.pix_fmt = pix_fmt
                set_up(stream)
            frame = av.VideoFrame.from_ndarray(picture, format="bgr24").reformat(format=pix_fmt)
            if ticks is not None:
                frame.pts, frame.time_base = int(ticks[index]), tick_s
            mux(stream.encode(frame))
        mux(stream.encode(None))
    return path


def write_video(path: Path, frame_count: int = 24, fps: float = 30.0) -> Path:
    """A textured square on a moving way, 320 x 180, MPEG-4 in mp4 or by suffix."""
    codec = "MJPG" if path.suffix == ".avi" else "mp4v"
    fourcc = cv2.VideoWriter.fourcc(*codec)
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, fourcc, fps, SIZE_PX)
    assert writer.isOpened()
    texture = np.random.default_rng(0).integers(0, 255, (24, 24, 3), dtype=np.uint8)
    for index in range(frame_count):
        frame = np.full((SIZE_PX[1], SIZE_PX[0], 3), 128, np.uint8)
        frame[80:104, 20 + index : 44 + index] = texture
        writer.write(frame)
    writer.release()
    return path


def with_index_first(mp4: bytes) -> bytes:
    """The same mp4 with its index (moov) before its data, as cameras and the web write it."""
    boxes = {kind: (start, size) for kind, start, size in _boxes(mp4, 0, len(mp4))}
    moov_start, moov_size = boxes[b"moov"]
    moov = bytearray(mp4[moov_start : moov_start + moov_size])
    at = moov.index(b"stco") + 8
    (count,) = struct.unpack_from(">I", moov, at)
    for entry in range(at + 4, at + 4 + 4 * count, 4):
        (offset,) = struct.unpack_from(">I", moov, entry)
        struct.pack_into(">I", moov, entry, offset + moov_size)
    data_start = boxes[b"mdat"][0]
    return mp4[:data_start] + bytes(moov) + mp4[data_start:moov_start]


def with_uneven_frames(mp4: bytes) -> bytes:
    """The same mp4 with half the step between frames in the first half, 3/2 in the second."""
    content = bytearray(mp4)
    at = content.index(b"stts")
    version, entries, count, step = struct.unpack_from(">IIII", content, at + 4)
    assert entries == 1
    halves = (count // 2, step // 2, count - count // 2, step + step // 2)
    content[at + 4 : at + 20] = struct.pack(">IIIIII", version, 2, *halves)
    for kind in (b"moov", b"trak", b"mdia", b"minf", b"stbl", b"stts"):
        size_at = content.index(kind) - 4
        (size,) = struct.unpack_from(">I", content, size_at)
        struct.pack_into(">I", content, size_at, size + 8)
    return bytes(content)


def _boxes(mp4: bytes, start: int, end: int) -> list[tuple[bytes, int, int]]:
    found = []
    while start < end:
        size, kind = struct.unpack_from(">I4s", mp4, start)
        found.append((kind, start, size))
        start += size
    return found

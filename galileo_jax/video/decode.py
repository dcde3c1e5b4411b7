"""Films as streams of upright pictures with square pixels, each with the time it was taken."""

import functools
import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import av.error
import av.filter
import cv2
import numpy as np

from galileo_jax.runtime.errors import InputError
from galileo_jax.video import steady
from galileo_jax.video.stamps import (
    at_declared_rate,
    clock_of,
    each_times,
    is_blank,
    listed,
    repeats,
)
from galileo_jax.video.weave import NO_ROWS, Rows, first_field, rows_of

MIN_FRAMES = 4  # fewer show no change of speed; also tells a picture from a film
MAX_MISSING_SHARE = 0.02  # only warned of: containers miscount by one or two
BLOCK_PX = 8  # pictures are compared by blocks' means, which noise hardly changes
SQUARE = 1e-3  # pixels whose sides differ by less are taken as square
KINDS = "?IPBSipb"  # FFmpeg's kinds of pictures by number
FIELDS = "bwdif=mode=send_field:parity={}"  # of each interlaced picture two


@dataclass(frozen=True)
class VideoInfo:
    """What decoding a whole film showed."""

    size_px: tuple[int, int]  # (width, height), of square pixels, upright
    fps: float  # the declared rate, or the film's where none was declared
    container_fps: float  # the film's own
    times_s: tuple[float, ...]  # when each picture that is looked at was taken, from the first on
    warnings: tuple[str, ...] = ()  # doubts, one line each
    # whether the camera turns away from what it saw at first, so far that pictures are left out
    turns_away: bool = False

    @property
    def frame_count(self) -> int:
        """Pictures that are looked at."""
        return len(self.times_s)


def frames(path: Path) -> Iterator[np.ndarray]:
    """Yields the pictures that are looked at one by one, `[height, width, 3]` uint8, BGR.

    As players show them: upright, with square pixels, without what an edit list hides; an
    interlaced picture is two, one for each of its fields. Pictures that repeat the one before,
    and black or faded ones at the beginning and the end, are left out. Where the camera moves they
    are drawn as if it had rested where it took the first.

    Raises `InputError` for a missing or undecodable file. A file that breaks off ends the
    iteration; `probe` is what tells it from a whole one.
    """
    scan = _scan(Path(path))
    pictures = _pictures(Path(path), scan)
    return pictures if scan.camera is None else steady.drawn(pictures, scan.camera)


def probe(path: Path, fps_declared: float | None = None) -> VideoInfo:
    """Decodes the whole film once and says what it is.

    Keeps some pictures, however many there are, and some bytes of each. A declared rate that
    contradicts the container's is only warned of: high-speed films often say 29.97.

    Raises `InputError` if the file is missing, empty, no film, a picture, or cut off; or if its
    pictures' times are missing, twice the same, or go back.
    """
    path = Path(path)
    scan = _scan(path)
    _check_whole(path, scan)
    film = clock_of(_stamps(path, scan, fps_declared), scan.tick_s)
    fields = 2 if scan.is_interlaced else 1
    warnings = [f"{path}: {line}" for line in scan.warnings()]
    rate = scan.rate if abs(scan.rate * fields / film.rate - 1) < 1e-3 else film.rate / fields
    clock, fps = film, rate
    if fps_declared:
        clock, compared = at_declared_rate(film, fps_declared * fields)
        fps = fps_declared
        if abs(fps * fields / compared - 1) > 0.01:
            warnings.append(
                f"{path}: fps: {fps:g} declared, the container says {compared / fields:.4g}; "
                f"{fps:g} is used"
            )
    times_s = clock.times_s[scan.used]
    seconds = tuple((times_s - times_s[0]).tolist())
    return VideoInfo(scan.size_px, fps, rate, seconds, (*warnings,), bool(scan.camera_lost))


def announced(path: Path) -> tuple[int, float]:
    """(pictures, s) of a film as its container says, at once; 0 for what it does not say.

    Raises `InputError` for a missing or undecodable file.
    """
    with _opened(Path(path)) as (container, stream):
        seconds = 0.0
        if stream.duration:
            seconds = float(stream.duration * stream.time_base)
        elif container.duration:
            seconds = container.duration / av.time_base
        return stream.frames or round(seconds * float(stream.average_rate or 0)), seconds


def predicted_from_before(path: Path) -> np.ndarray:
    """`[picture]`, bool: whether a picture was coded as what changes since the one before it.

    Not so are whole pictures (I), those that are predicted from both sides (B), those that follow
    them, and all of a film whose pixels are not those that were coded, as where the camera moves.
    Where a file does not say, pictures count as predicted.

    Raises `InputError` as `frames`.
    """
    scan = _scan(Path(path))
    kinds = np.array(list(scan.kinds.replace("?", "P")))
    is_predicted = kinds == "P"
    is_predicted[1:] &= kinds[:-1] != "B"
    # What comes after a picture that is left out is not predicted from the one before that.
    is_predicted[1:] &= scan.used[:-1]
    return is_predicted[scan.used] & (
        scan.is_square and not scan.is_interlaced and scan.camera is None
    )


def is_interlaced(path: Path) -> bool:
    """Whether pictures are fields, of which their colours may be mixed.

    Raises `InputError` as `frames`.
    """
    return _scan(Path(path)).is_interlaced


@dataclass(frozen=True)
class _Scan:
    """What one pass through a film shows."""

    size_px: tuple[int, int]  # (width, height) as shown
    pixel_aspect: float  # width of a pixel by its height
    # pictures are fields, of which each frame's first is the upper ("tff") or lower one ("bff");
    # None: they are whole
    first_field: str | None
    stamps_s: np.ndarray  # `[picture]`; NaN where missing
    is_even: bool  # the container knows no times, only a rate
    tick_s: float  # what they are rounded to
    kinds: str  # a letter for each picture
    change: np.ndarray  # `[picture]`, grey levels, see `repeats`
    contrast: np.ndarray  # `[picture]`, grey levels
    rate: float  # pictures per second that the container states; 0: none
    missing: int  # pictures that it announces and that are not there
    # from each picture that is looked at to the first of them, px, where the camera moves
    camera: steady.Homographies | None = None
    # pictures in which it has moved, and where it looks then nothing tells that stands still
    camera_lost: tuple[int, ...] = ()

    @property
    def is_interlaced(self) -> bool:
        """Whether pictures are fields."""
        return self.first_field is not None

    @property
    def is_square(self) -> bool:
        """Whether pixels are as wide as high."""
        return abs(self.pixel_aspect - 1) < SQUARE

    @property
    def used(self) -> np.ndarray:
        """`[picture]`: which are looked at."""
        found = ~(is_blank(self.contrast) | repeats(self.change))
        found[list(self.camera_lost)] = False
        return found

    def warnings(self) -> Iterator[str]:
        """What is said of the film, and of pictures that are not looked at."""
        if not self.is_square:
            yield (
                f"pixels are {self.pixel_aspect:.4g} times as wide as high; pictures are taken as "
                f"{self.size_px[0]} x {self.size_px[1]} square ones, as players show them"
            )
        if self.is_interlaced:
            yield (
                "interlaced: each picture is taken as two, one for each of its fields, with their "
                "own times; frame numbers count fields"
            )
        blank = is_blank(self.contrast)
        counted = "; frame numbers count the others"
        if blank.any():
            numbers, word = np.flatnonzero(blank), "is" if blank.sum() == 1 else "are"
            yield f"picture {listed(numbers)} {word} black, blank or faded and left out{counted}"
        numbers, total = np.flatnonzero(repeats(self.change) & ~blank), len(blank)
        if len(numbers):
            kept = total - len(numbers)
            yield (
                f"{len(numbers)} of {total} pictures repeat the one before"
                f"{each_times(total, kept)} ({listed(numbers)}): left out{counted}"
            )
        if self.camera is not None:
            off = steady.displacements_px(self.camera, self.size_px[::-1])
            yield (
                f"the camera moves by up to {np.abs(off).max():.0f} px: pictures are drawn as if "
                "it had rested, by what stands still in them; places are those of the first"
            )
        if self.camera_lost:
            yield (
                f"in picture {listed(np.array(self.camera_lost))} the camera has moved, and too "
                f"little stands still to tell how: left out{counted}"
            )
        if self.missing:
            yield f"{total} of {total + self.missing} announced frames can be decoded"


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """The container and its video stream."""
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if not path.is_file():
        raise InputError(f"{path}: not a file; a video expected")
    if not os.access(path, os.R_OK):
        raise InputError(f"{path}: cannot be read (permissions)")
    if path.stat().st_size == 0:
        raise InputError(f"{path}: empty file (0 bytes); a video expected")
    try:
        container = av.open(str(path))
    except av.error.FFmpegError as error:
        raise InputError(
            f"{path}: cannot be decoded: neither a video nor a table (csv, txt, xlsx, json, mat, "
            "trk), or a video cut off before its index; copy it from the camera again"
        ) from error
    with container:
        stream: Any = container.streams.best("video")
        if stream is None:
            raise InputError(
                f"{path}: cannot be decoded: there are no pictures in it; a video expected"
            )
        stream.thread_type = "AUTO"
        yield container, stream


def _shown(container: Any, stream: Any, first: str | None) -> Iterator[Any]:
    """The frames in the order in which they are shown, or the fields that they are woven from."""
    decoded = _decoded(container, stream)
    return decoded if first is None else _filtered(decoded, stream, FIELDS.format(first))


def _decoded(container: Any, stream: Any) -> Iterator[Any]:
    """All frames; damaged parts are passed over."""
    packets = container.demux(stream)
    while True:
        try:
            packet = next(packets)
        except (StopIteration, av.error.FFmpegError):
            return
        with suppress(av.error.FFmpegError):  # of this packet; what follows may be whole
            yield from packet.decode()


def _filtered(decoded: Iterator[Any], stream: Any, filter_: str) -> Iterator[Any]:
    """The frames as one of FFmpeg's filters makes them."""
    graph = av.filter.Graph()
    nodes = graph.add_buffer(template=stream), graph.add(*filter_.split("=", 1))
    graph.link_nodes(*nodes, graph.add("buffersink")).configure()
    for frame in itertools.chain(decoded, (None,)):  # None: that was all
        graph.vpush(frame)
        while True:
            try:
                yield graph.vpull()
            except (av.error.BlockingIOError, av.error.EOFError):
                break


def _scan(path: Path) -> _Scan:
    found = path.stat() if path.is_file() else None
    stamp = (found.st_mtime_ns, found.st_size, found.st_ino) if found is not None else ()
    return _scanned(path, path.resolve(), *stamp)


@functools.lru_cache(64)
def _scanned(path: Path, _whole: Path, *_stamp: int) -> _Scan:
    """Once for each content: who draws marks has the clip checked at every step."""
    scan, rows, glimpses = _passed(path, None)
    if (first := first_field(rows)) is not None:
        scan, _, glimpses = _passed(path, first)
    if len(scan.kinds) == 0:
        raise InputError(f"{path}: cannot be decoded: without frames, or damaged; a video expected")
    return _with_camera(path, scan) if glimpses.camera_moves(scan.used) else scan


def _with_camera(path: Path, scan: _Scan) -> _Scan:
    """With how the camera moves, and where that is not told."""
    smaller = (
        steady.small(cv2.cvtColor(picture, cv2.COLOR_BGR2GRAY)) for picture in _pictures(path, scan)
    )
    found = list(steady.to_first(smaller))
    known = [one for one in found if one is not None]
    looked_at = np.flatnonzero(scan.used)
    lost = [int(n) for n, one in zip(looked_at, found, strict=True) if one is None]
    factor = scan.size_px[0] / min(scan.size_px[0], steady.WIDEST_PX)
    camera = steady.enlarged(np.stack(known), factor)
    return replace(scan, camera=camera, camera_lost=tuple(lost))


def _pictures(path: Path, scan: _Scan) -> Iterator[np.ndarray]:
    """As `frames`, wherever the camera was."""
    with _opened(path) as opened:
        for is_used, frame in zip(scan.used, _shown(*opened, scan.first_field), strict=False):
            if not is_used:
                continue
            picture = np.rot90(frame.to_ndarray(format="bgr24"), round(frame.rotation / 90) % 4)
            picture = np.ascontiguousarray(picture)
            if picture.shape[1::-1] != scan.size_px:
                picture = cv2.resize(picture, scan.size_px, interpolation=cv2.INTER_LANCZOS4)
            yield picture


def _passed(path: Path, first: str | None) -> tuple[_Scan, Rows, steady.Glimpses]:
    """What one pass shows, of whole pictures or of fields, and what `first_field` reads."""
    stamps_s, kinds, change, contrast, rows = [], [], [], [], NO_ROWS
    size_px, tick_s, before, glimpses = (0, 0), 0.0, None, steady.Glimpses()
    with _opened(path) as (container, stream):
        aspect, rate = float(stream.sample_aspect_ratio or 1), float(stream.average_rate or 0)
        is_even = container.format.name == "avi"  # whose stamps are the order of coding
        for frame in _shown(container, stream, first):
            grey = frame.to_ndarray(format="gray")
            if before is None:
                size_px = _shown_size(frame, aspect)
            elif first is None:
                rows = rows + rows_of(before, grey)
            change.append(np.inf if before is None else _change(before, grey))
            contrast.append(float(cv2.meanStdDev(grey)[1][0, 0]))
            glimpses.add(grey)
            stamps_s.append(np.nan if frame.pts is None else float(frame.pts * frame.time_base))
            kinds.append(KINDS[int(frame.pict_type)].upper())
            tick_s, before = float(frame.time_base or 0), grey
        missing = _num_missing(container, stream, np.array(stamps_s))
    stamps = np.sort(stamps_s) if is_even else np.array(stamps_s)
    scan = _Scan(
        size_px, aspect, first, stamps, is_even, tick_s, "".join(kinds), np.array(change),
        np.array(contrast), rate, missing,
    )  # fmt: skip
    return scan, rows, glimpses


def _shown_size(frame: Any, aspect: float) -> tuple[int, int]:
    """(width, height) of a frame with square pixels, none of which is smaller than before."""
    width, height = frame.width, frame.height
    if abs(aspect - 1) >= SQUARE:
        width, height = (round(width * max(aspect, 1)), round(height * max(1 / aspect, 1)))
    return (height, width) if round(frame.rotation / 90) % 2 else (width, height)


def _change(before: np.ndarray, grey: np.ndarray) -> float:
    """By how much two pictures differ in the block of pixels in which they differ most."""
    if before.shape != grey.shape:
        return np.inf
    size = tuple(max(1, side // BLOCK_PX) for side in grey.shape[::-1])
    differs = cv2.resize(cv2.absdiff(grey, before), size, interpolation=cv2.INTER_AREA)
    return float(differs.max())


def _num_missing(container: Any, stream: Any, stamps_s: np.ndarray) -> int:
    """Pictures that the container announces, in number and in time, beyond those there are.

    An edit list, or a last picture that is shown for long, differs in one of the two only.
    """
    count = len(stamps_s)
    by_number = stream.frames - count if stream.frames else np.inf
    known = np.sort(stamps_s[np.isfinite(stamps_s)])
    if len(known) < 2 or np.ptp(known) == 0:
        return int(by_number) if np.isfinite(by_number) else 0
    step_s = float(np.median(np.diff(known)))
    if container.format.name == "avi":  # whose duration is made up where it breaks off
        end_s = known[0] + stream.frames / float(stream.average_rate)
    elif stream.duration:
        end_s = float(((stream.start_time or 0) + stream.duration) * stream.time_base)
    elif container.duration and len(container.streams) == 1:
        end_s = ((container.start_time or 0) + container.duration) / av.time_base
    else:
        return 0
    by_time = (end_s - known[-1]) / step_s - 1
    return max(0, round(min(by_number, by_time)))


def _check_whole(path: Path, scan: _Scan) -> None:
    count, left = len(scan.kinds), int(scan.used.sum())
    if count < MIN_FRAMES:
        raise InputError(
            f"{path}: only {count} frame(s); a video of the whole motion, at least {MIN_FRAMES} "
            "frames, expected"
        )
    announced = count + scan.missing
    if scan.missing > max(2, MAX_MISSING_SHARE * announced):
        raise InputError(
            f"{path}: cut off or damaged: only {count} of {announced} frames can be decoded; "
            "copy it again, or re-encode what is there"
        )
    if left < MIN_FRAMES:
        raise InputError(
            f"{path}: only {left} of {count} frames are neither blank nor repeat the one before; "
            f"at least {MIN_FRAMES} expected"
        )


def _stamps(path: Path, scan: _Scan, fps_declared: float | None) -> np.ndarray:
    """The time stamps, increasing, s.

    Raises `InputError` where they are missing, twice the same, or go back; but for the last one,
    which some programs do not write, and where the container knows none.
    """
    stamps_s, count = scan.stamps_s.copy(), len(scan.stamps_s)
    is_there = np.isfinite(stamps_s)
    if not is_there.any() or (scan.is_even and not (np.diff(stamps_s) > 0).all()):
        rate = scan.rate or fps_declared
        if not rate:
            raise InputError(f"{path}: the container states no frame rate; declare fps")
        return np.arange(count) / rate
    steps = np.diff(stamps_s[:-1])
    if not stamps_s[-1] > stamps_s[-2] and (steps > 0).all():
        stamps_s[-1] = stamps_s[-2] + np.median(steps)
    wrong = 1 + np.flatnonzero(~(np.diff(stamps_s) > 0))
    if len(wrong) or not np.isfinite(stamps_s[0]):
        numbers = np.flatnonzero(~is_there)
        what = "have no time stamp" if len(numbers) else "are not later than the one before"
        raise InputError(
            f"{path}: time stamps: pictures {listed(numbers if len(numbers) else wrong)} {what}; "
            f"write the film anew at a constant rate: ffmpeg -i {path.name} -vf fps=RATE new.mp4"
        )
    return stamps_s

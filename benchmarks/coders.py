"""What coders do to a track: `python benchmarks/coders.py --num 12`.

Films the same random experiments (`rendered_clips.py`, with faults) with several coders, and tracks
each with and without the places' correction for motion compensation. Of what moves, away from the
foot and the hit: the standard deviation of the errors, px, their correlation from frame to frame,
both less each stretch's mean, and the medians of the amplitudes that the videos showed. Coders
other than OpenCV's MPEG-4 need `pip install imageio-ffmpeg`. The last line is JSON.
"""

import argparse
import itertools
import json
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np
import rendered_clips
import tables
from tracking import true_points

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.commands import command
from galileo_jax.tracking import motion_compensation
from galileo_jax.tracking.clip import track_clip
from galileo_jax.tracking.motion_compensation import STEPS_PER_PX, coding_shift_amplitudes_px
from galileo_jax.tracking.track import Track

OPTIONS = {
    "mpeg4": None,  # as `simulate` writes it
    "lossless": ("libx264", "-qp", "0", "-preset", "ultrafast"),
    "h264": ("libx264", "-crf", "20", "-bf", "0", "-g", "30", "-preset", "fast"),
    "h264 b": ("libx264", "-crf", "23"),
    "h265": ("libx265", "-crf", "24", "-bf", "0"),
}
WRITER = "galileo_jax.video.synthetic.render.cv2.VideoWriter"
MOVES_PX, NEAR_FRAMES, FEWEST = 0.3, 2, 12


def main(argv: Sequence[str]) -> int | None:
    call = _parser().parse_args(argv)
    amplitude = ("whole px", "half px", "quarter px")
    tables.row("coder", ("sd before", "sd", "lag1 before", "lag1", *amplitude))
    figures = {}
    for name in call.only or OPTIONS:
        amplitudes: list[np.ndarray] = []
        plain: list[np.ndarray] = []
        mended: list[np.ndarray] = []
        for seed in range(call.seed, call.seed + call.num):
            with tempfile.TemporaryDirectory() as folder:
                path = filmed(Path(folder), seed, OPTIONS[name])
                found, without, with_it = errors(path)
            amplitudes.append(found)
            plain += without
            mended += with_it
        before, after = scatter(plain), scatter(mended)
        by_step = np.median(np.concatenate(amplitudes).reshape(-1, len(STEPS_PER_PX)), axis=0)
        row = (before[0], after[0], before[1], after[1], *by_step)
        tables.row(name, [float(value) for value in row])
        figures[name] = row
    tables.finish("coders", figures | {"num": call.num, "seed": call.seed})
    return None


def filmed(folder: Path, seed: int, options: Sequence[str] | None) -> Path:
    """The clip's yaml, its video written by FFmpeg with these options."""
    if options is None:
        return rendered_clips.render(folder, rendered_clips.FAULTY, seed).clips[0]

    class Writer:
        """In place of OpenCV's."""

        fourcc = staticmethod(cv2.VideoWriter.fourcc)

        def __init__(self, path: str, _: int, fps: float, size: tuple[int, int]):
            from imageio_ffmpeg import get_ffmpeg_exe  # pyright: ignore

            raw = ("-f", "rawvideo", "-pix_fmt", "bgr24", "-s", f"{size[0]}x{size[1]}")
            call = (get_ffmpeg_exe(), "-y", "-loglevel", "error", *raw, "-r", str(fps), "-i", "-")
            coded = ("-c:v", *options, "-pix_fmt", "yuv420p", path)
            self.process = subprocess.Popen([*call, *coded], stdin=subprocess.PIPE)

        def isOpened(self) -> bool:  # noqa: N802, as OpenCV calls it
            return True

        def write(self, frame: np.ndarray) -> None:
            assert self.process.stdin is not None
            self.process.stdin.write(np.ascontiguousarray(frame).tobytes())

        def release(self) -> None:
            self.process.communicate()

    with patch(WRITER, Writer):
        return rendered_clips.render(folder, rendered_clips.FAULTY, seed).clips[0]


def errors(path: Path) -> tuple[np.ndarray, list[np.ndarray], list[np.ndarray]]:
    """Of a clip what tracking it shows.

    Returns:
      The amplitudes `[object, 2, step]`, px; the errors of each stretch, px, without and with the
      correction.
    """
    clip, record = load_clip(path), json.loads(path.with_suffix(".truth.json").read_text())
    found: list[np.ndarray] = []

    def watched(*given: Any) -> np.ndarray:
        found.append(coding_shift_amplitudes_px(*given))
        return found[-1]

    def none(paths: Sequence[Any], *_: Any) -> np.ndarray:
        return np.zeros((len(paths), 2, len(STEPS_PER_PX)))

    both = []
    for search in (none, watched):
        with patch.object(motion_compensation, "coding_shift_amplitudes_px", search):
            both.append(list(stretches(clip, record, track_clip(clip))))
    return found[0], both[0], both[1]


def stretches(clip: Clip, record: dict[str, Any], track: Track) -> Iterator[np.ndarray]:
    """Errors of what moves along an axis between two events, px, less their mean."""
    events = [time * clip.fps for time in map(record["events_s"].get, ("foot", "hit")) if time]
    for i in range(len(track.names)):
        true = true_points(clip, record, i)[: len(track.times_s)]
        frames = np.arange(len(true))
        error = track.position_px[i, : len(true)] - true
        near = np.any([abs(frames - event) < NEAR_FRAMES for event in events], axis=0)
        usable = track.is_visible[i, : len(true)] & ~near
        moves = np.abs(np.diff(true, axis=0, prepend=true[:1])) > MOVES_PX
        part = np.searchsorted(events, frames)
        for axis, number in itertools.product(range(2), range(len(events) + 1)):
            own = usable & moves[:, axis] & (part == number)
            if own.sum() >= FEWEST:
                yield error[own, axis] - error[own, axis].mean()


def scatter(stretches: Sequence[np.ndarray]) -> tuple[float, float]:
    """Standard deviation, px, and correlation from frame to frame."""
    square = sum(float(part @ part) for part in stretches)
    count = sum(len(part) for part in stretches)
    neighbours = sum(float(part[1:] @ part[:-1]) for part in stretches)
    return float(np.sqrt(square / count)), neighbours / square


def _parser() -> command.Parser:
    parser = command.Parser(prog="coders.py", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--num", type=command.whole_number(1), default=12, help="clips")
    parser.add_argument("--seed", type=command.whole_number(0), default=0, help="of the first")
    parser.add_argument("--only", nargs="+", choices=tuple(OPTIONS), help="coders (default: all)")
    return parser


if __name__ == "__main__":
    raise SystemExit(command.run(main))

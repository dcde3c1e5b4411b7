"""`galileo track`: track the objects of a clip; check the overlay by eye."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import galileo_jax as gx
from galileo_jax.clip.load import load_clip
from galileo_jax.commands import command
from galileo_jax.commands.clip_options import corrections, warn
from galileo_jax.commands.options import VerbParser
from galileo_jax.runtime.atomic_write import check_folder, writing_into
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.track import Track


def main(argv: Sequence[str]) -> None:
    """Writes DIR/track_px.csv, track_m.csv (if the scale is known), overlay.mp4, overlay.png."""
    asked = _parser().asked(argv)
    clip = load_clip(asked["clip"], pixels_per_metre=asked.get("pixels_per_metre"))
    warn(clip.warnings)
    if clip.video is None:
        raise InputError(f"{clip.path}: video: missing; a csv track is already tracked")
    out: Path = asked.get("out", Path(f"{clip.path.stem}_track"))
    check_folder(out)
    with command.progress_display() as display:
        correct = corrections(asked.get("correct", ()))
        found = gx.track(clip, correct=correct, on_progress=display)
        assert found.pixels is not None  # of a video
        with writing_into(out):
            written = found.save_tables(out)
            display("drawing the overlay", 1.0)
            written += found.save_overlay(out)
    warn(found.warnings[len(clip.warnings) :])
    for line in _summary(found.pixels):
        command.say(line)
    if out / "track_m.csv" not in written:
        command.say(
            "note: no csv in metres, because pixels_per_metre is not known; give --pixels-per-metre"
        )
    print("\n".join(map(str, written)))


def _summary(track: Track) -> list[str]:
    lines = []
    for k, name in enumerate(track.names):
        seen = track.is_visible[k]
        if not seen.any():
            lines.append(f"{name}: not seen in any frame")
            continue
        variance = np.trace(track.covariance_px2[k, seen], axis1=1, axis2=2) / 2
        sd_px = float(np.median(np.sqrt(variance)))
        frames = np.flatnonzero(seen)
        lines.append(
            f"{name}: seen in {seen.sum()} of {len(seen)} frames (first {frames[0]}, last "
            f"{frames[-1]}), to {sd_px:.3f} px"
        )
    return lines


def _parser() -> VerbParser:
    parser = VerbParser(
        "track",
        "Track the objects of a clip. Writes csv tracks in pixels and, if the scale "
        "is known, in metres, and a video with the paths drawn over it.",
        "galileo track clip.mp4",
        "galileo track clip.mp4 --pixels-per-metre 640 --out tracked",
    )
    parser.add("clip", type=Path, metavar="CLIP", help="video or its yaml")
    parser.out("where to write (default: NAME_track)")
    parser.add("pixels_per_metre")
    parser.add_argument(
        "--correct",
        nargs="+",
        action="append",
        metavar=("NAME", "FRAME"),
        help="NAME FRAME X Y: where it is (pixels) in a frame in which it was lost; tracking "
        "continues from there, in addition to the yaml's corrections",
    )
    return parser

"""`galileo track`: follow a clip's objects; csv, and an overlay to check by eye."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.commands import command
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking import Track, track_clip
from galileo_jax.tracking.overlay import write_overlay_picture, write_overlay_video
from galileo_jax.tracking.pixel_csv import write_pixel_csv
from galileo_jax.tracking.to_metres import observe
from galileo_jax.video import decode


def main(argv: Sequence[str]) -> int | None:
    """Writes DIR/track_px.csv, track_m.csv (if the scale is known), overlay.mp4, overlay.png."""
    call = _parser().parse_args(argv)
    clip = load_clip(call.clip, pixels_per_metre=call.pixels_per_metre)
    for warning in clip.warnings:
        _say(f"warning: {warning}")
    if clip.video is None:
        raise InputError(f"{clip.path}: video: missing; a csv track is tracked already")
    out: Path = call.out or Path(f"{clip.path.stem}_track")
    with command.progress() as bar:
        track = track_clip(clip)
        task = bar.add_task("drawing", total=clip.frame_count)
        try:
            out.mkdir(parents=True, exist_ok=True)
            write_pixel_csv(out / "track_px.csv", track)
            written = ["track_px.csv"]
            if clip.pixels_per_metre is not None:
                write_observation_csv(out / "track_m.csv", observe(clip, track))
                written.append("track_m.csv")
            write_overlay_picture(out / "overlay.png", decode.frames(clip.video), track)
            write_overlay_video(
                out / "overlay.mp4",
                decode.frames(clip.video),
                track,
                advance=lambda: bar.advance(task),
            )
        except OSError as error:
            raise InputError(f"--out: {out}: {error.strerror or error}") from error
    for line in _summary(track):
        _say(line)
    if clip.pixels_per_metre is None:
        _say("note: no csv in metres: pixels_per_metre is not known; give --pixels-per-metre")
    for name in [*written, "overlay.png", "overlay.mp4"]:
        print(out / name)
    return None


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


def _say(line: str) -> None:
    command.console().print(line, soft_wrap=True, markup=False)


def _parser() -> command.Parser:
    parser = command.Parser(
        prog="galileo track",
        description="Follow the objects of a clip. Writes csv tracks in pixels and, if the scale "
        "is known, in metres, and the paths drawn over the video.",
    )
    parser.add_argument("clip", type=Path, metavar="CLIP", help="video or its yaml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="default: NAME_track")
    parser.add_argument("--pixels-per-metre", type=float, help="overrides the clip's scale")
    return parser

"""Tracking a clip: what is declared about the objects becomes outlines in the image."""

import math

from rich.progress import Progress

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.errors import InputError
from galileo_jax.tracking.template import Outline
from galileo_jax.tracking.track import Track
from galileo_jax.tracking.tracker import Start, track_video
from galileo_jax.video import decode


def track_clip(clip: Clip, *, progress: Progress | None = None) -> Track:
    """Follows the clip's objects through its video.

    Raises `InputError` if the clip has no video, or if an object without `point_px` cannot be
    found.
    """
    video = clip.video
    if video is None:
        raise InputError(f"{clip.path}: video: missing; a csv track is tracked already")
    starts = [
        Start(item.name, item.point_px, outline_of(clip, item), item.first_frame)
        for item in clip.objects
        if item.point_px is not None
    ]
    task = progress.add_task("tracking", total=2 * clip.frame_count) if progress else None

    def advance() -> None:
        if progress is not None and task is not None:
            progress.advance(task)

    return track_video(lambda: decode.frames(video), starts, clip.fps, advance=advance)


def outline_of(clip: Clip, item: ClipObject) -> Outline:
    """The outline of an object in its first frame, in pixels."""
    angle = _image_angle_rad(clip, item)
    scale = clip.pixels_per_metre
    if item.size_m is None or scale is None:
        return Outline(None, angle)
    match item.shape:
        case "box":
            return Outline((item.size_m[0] * scale, item.size_m[2] * scale), angle)
        case "sphere":
            side = 2 * item.size_m[0]
        case "cylinder":
            side = min(2 * item.size_m[0], item.size_m[1])
        case "torus":
            side = 2 * item.size_m[1]
    # A cylinder or torus may lie or stand: the disc that fits into it either way.
    return Outline((side * scale, side * scale), angle, is_round=True)


def _image_angle_rad(clip: Clip, item: ClipObject) -> float:
    """How the object stands in the image: along the ramp if it is on it, else level."""
    if not SCENARIOS[clip.scenario].has_ramp or clip.ramp_angle_deg is None:
        return 0.0
    along = 1.0 if clip.direction == "right" else -1.0
    if clip.scenario == "ramp":
        if clip.origin_px is None or item.point_px is None:
            return 0.0
        if along * (item.point_px[0] - clip.origin_px[0]) > 0:
            return 0.0
    return along * math.radians(clip.ramp_angle_deg)

"""Tracking a clip: what is declared about the objects becomes outlines in the image."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip, ClipObject
from galileo_jax.clip.sizes import half_sides
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.progress import report
from galileo_jax.tracking.contrast import in_contrast
from galileo_jax.tracking.detect import CameraMovesError, Mover, find_movers, fit_outline
from galileo_jax.tracking.fragments import Start
from galileo_jax.tracking.motion_compensation import Coding
from galileo_jax.tracking.picture import OpenFrames
from galileo_jax.tracking.pose import corners
from galileo_jax.tracking.silhouette import way_px
from galileo_jax.tracking.square_view import square_view
from galileo_jax.tracking.template import WINDOW_PX, Outline, grey
from galileo_jax.tracking.track import Track
from galileo_jax.tracking.tracker import Seen, track_video
from galileo_jax.video import decode

UNKNOWN_SPAN_PX = 40.0
"""Features of one object are within this of each other when its size is not known."""

FOLLOWS = 0.2  # of its way at least must be followed while it is seen

Point = tuple[float, float]


def track_clip(clip: Clip) -> Track:
    """Follows the clip's objects through its video; reports its progress frame by frame.

    Raises `InputError` if the clip has no video, or if an object without `point_px` cannot be
    found.
    """
    video = clip.video
    if video is None:
        raise InputError(f"{clip.path}: video: missing; a csv track is already tracked")
    sizes = _sizes_px(clip)
    is_told = all(item.point_px is not None for item in clip.objects) and None not in sizes
    passes = 2 if is_told else 3
    total, done = passes * max(clip.frame_count, 1), itertools.count(1)
    names = [item.name for item in clip.objects]
    view = None if clip.is_camera_plain else square_view(clip)

    def advance(seen: Seen | None = None) -> None:
        partial = None
        if seen is not None:
            drawn = seen.places_px if view is None else map(view.shown, seen.places_px)
            places = dict(zip(names, drawn, strict=True))
            partial = {"frame": {"index": seen.frame, "places_px": places}}
        report("tracking", next(done) / total, partial)

    def open_frames() -> Iterator[np.ndarray]:
        frames = decode.frames(video)
        return frames if view is None else view.drawn(frames)

    square = clip if view is None else view.clip(clip)
    is_mixed = decode.is_interlaced(video)
    shown = open_frames if is_mixed else in_contrast(open_frames, clip.frame_count)
    movers = [] if is_told else _movers(square, shown, advance)
    square = _with_points(square, movers, shown)
    starts = [_start(square, item, movers) for item in square.objects]
    coding = Coding(decode.predicted_from_before(video))
    if view is not None:
        coding = replace(coding, to_coded=view.to_picture, from_coded=view.from_picture)
    times_s = np.array(clip.frame_times_s)
    found = track_video(shown, starts, times_s, coding=coding, advance=advance)
    _check_followed(clip, square, found, movers)
    return found if view is None else view.track(found, clip)


def _start(clip: Clip, item: ClipObject, movers: Sequence[Mover]) -> Start:
    """Where an object is first seen, and where somebody has put it right."""
    assert item.point_px is not None

    def seen_at(point_px: Point, frame: int) -> Start:
        there = item.model_copy(update={"point_px": point_px})
        outline = outline_of(clip, there)
        if outline.size_px is None:
            outline = _seen_outline(outline, point_px, frame, movers)
        return Start(item.name, point_px, outline, frame)

    first = seen_at(item.point_px, item.first_frame or 0)
    later = tuple(seen_at((x, y), frame) for frame, x, y in sorted(item.corrections))
    return replace(first, last_frame=item.last_frame, corrections=later)


def _seen_outline(
    outline: Outline, point_px: Point, frame: int, movers: Sequence[Mover]
) -> Outline:
    """An outline with the size that is seen: as far about the point as the thing is on both sides.

    A shadow on one side of it, or what holds it, is then left out. Of the smallest thing that is
    seen there; of unknown size where there is none.
    """
    found: list[tuple[float, float]] = []
    for mover in movers:
        around = mover.places_px + mover.way_px[frame] - point_px
        low, high = corners(around, outline.angle_rad)
        width, height = 2 * np.minimum(-low, high)
        if min(width, height) > WINDOW_PX:  # NaN, where it is not seen, compares False
            found.append((float(width), float(height)))
    if not found:
        return outline
    width, height = min(found, key=math.prod)
    if outline.is_round:
        width = height = min(width, height)
    return replace(outline, size_px=(width, height))


def _movers(clip: Clip, open_frames: OpenFrames, advance: Callable[[], None]) -> list[Mover]:
    """What moves in a film of which a mark or a size is not told; empty where the camera does."""
    sizes = _sizes_px(clip)
    try:
        return find_movers(
            open_frames,
            _span_px(sizes),
            axes_angle_rad=_ramp_angle_rad(clip),
            may_fly=not SCENARIOS[clip.scenario].has_surface,
            outlined=None in sizes,
            wanted=sum(item.point_px is None for item in clip.objects),
            advance=advance,
        )
    except CameraMovesError as error:
        if all(item.point_px is not None for item in clip.objects):
            return []
        raise InputError(f"{clip.path}: objects: point_px: missing, and {error}") from None


def _with_points(clip: Clip, movers: Sequence[Mover], open_frames: OpenFrames) -> Clip:
    """The clip with a `point_px` for every object: those not declared go to what moves."""
    missing = [item for item in clip.objects if item.point_px is None]
    if not missing:
        return clip
    span = _span_px(_sizes_px(clip))
    taken = [item.point_px for item in clip.objects if item.point_px is not None]
    movers = [m for m in movers if all(math.dist(m.point_px, point) > span for point in taken)]
    if len(movers) < len(missing):
        name = missing[len(movers)].name
        raise InputError(
            f"{clip.path}: objects ({name}): point_px: missing, and only {len(movers)} moving "
            f"object(s) found to take for {len(missing)}; mark it: "
            f"galileo label {clip.video or clip.path} --help"
        )
    first = grey(next(iter(open_frames())))
    found: dict[str, ClipObject] = {}
    for item, mover in zip(missing, movers, strict=False):
        found_at = {"point_px": mover.point_px, "first_frame": mover.first_frame}
        marked = item.model_copy(update=found_at)
        outline = outline_of(clip, marked)
        if outline.size_px is not None and mover.num_features:
            centre = fit_outline(first, mover.places_px, outline)
            marked = marked.model_copy(update={"point_px": centre})
        found[item.name] = marked
    objects = tuple(found.get(item.name, item) for item in clip.objects)
    return clip.model_copy(update={"objects": objects})


def _check_followed(clip: Clip, marked: Clip, track: Track, movers: Sequence[Mover]) -> None:
    """Raises `InputError` where what was found to move is not what was followed.

    `marked`: the clip with the places that were found.
    """
    for i, (item, found) in enumerate(zip(clip.objects, marked.objects, strict=True)):
        if item.point_px is not None:
            continue
        mover = min(movers, key=lambda one: math.dist(one.point_px, found.point_px or (0.0, 0.0)))
        both = track.is_visible[i] & np.isfinite(mover.way_px[:, 0])
        if not both.any():
            continue
        moves, goes = way_px(mover.way_px[both]), way_px(track.position_px[i][both])
        if moves > WINDOW_PX and goes < FOLLOWS * moves:
            raise InputError(
                f"{clip.path}: objects ({item.name}): point_px: missing, and what was found there "
                f"moves by {moves:.0f} px, but what could be followed by {goes:.1f} px only; mark "
                f"it: galileo label {clip.video} --help"
            )


def _sizes_px(clip: Clip) -> list[Point | None]:
    """The sizes of the objects in the picture, None where it is not known."""
    return [outline_of(clip, item).size_px for item in clip.objects]


def _span_px(sizes: Sequence[Point | None]) -> float:
    """About the size of an object: the largest that is known."""
    return max((max(size) for size in sizes if size is not None), default=UNKNOWN_SPAN_PX)


def outline_of(clip: Clip, item: ClipObject) -> Outline:
    """The outline of an object in its first frame, in pixels."""
    angle = _image_angle_rad(clip, item)
    scale = clip.pixels_per_metre
    if item.size_m is None or scale is None:
        return Outline(None, angle, is_round=item.shape != "box")
    length, height = (2 * half * scale for half in half_sides(item.shape, item.size_m))
    if item.shape == "box":
        return Outline((length, height), angle)
    # A puck, which lies flat and is seen from above, and what rolls show their length; another
    # cylinder or torus may lie or stand: the disc that fits into it either way.
    side = length if SCENARIOS[clip.scenario].is_level or item.rolls else min(length, height)
    return Outline((side, side), angle, is_round=True)


def _image_angle_rad(clip: Clip, item: ClipObject) -> float:
    """How the object stands in the image: along the ramp if it is on it, else level."""
    if clip.scenario == "ramp":
        if clip.origin_px is None or item.point_px is None:
            return 0.0
        if clip.sign * (item.point_px[0] - clip.origin_px[0]) > 0:
            return 0.0
    return _ramp_angle_rad(clip)


def _ramp_angle_rad(clip: Clip) -> float:
    """How the ramp's surface is turned in the image, clockwise positive; 0 without a ramp."""
    if not SCENARIOS[clip.scenario].has_ramp or clip.ramp_angle_deg is None:
        return 0.0
    return clip.sign * math.radians(clip.ramp_angle_deg)

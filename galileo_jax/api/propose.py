"""`propose`: what a video that nobody has declared anything about seems to show."""

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from galileo_jax.clip.fields import Direction
from galileo_jax.clip.load import check_clip
from galileo_jax.clip.schema import Clip
from galileo_jax.measurement.measure import measure
from galileo_jax.runtime import progress
from galileo_jax.runtime.errors import InputError
from galileo_jax.runtime.precision import in_float64
from galileo_jax.tracking.detect import CameraMovesError, Mover, find_movers
from galileo_jax.tracking.pose import rotation
from galileo_jax.video import decode

SPAN_PX = 40.0  # features of one object are this close together, as where its size is unknown
SCALE = 500.0  # pixels per metre while nobody knows; what is proposed is in pixels again
EDGE_SHARE = 0.15  # of the width: so near to the border no table is seen beyond a foot
SMALLEST_PX = 6.0  # of an object, in the picture
DETECTED = 0.3  # share of the work, for progress

Point = tuple[float, float]


@dataclass(frozen=True)
class Proposal:
    """What to draw into a video before a person has marked anything; pixels, x right, y down.

    Attributes:
      scenario: flight where something flies, which is the first object; ramp where the first
        object's path bends to the level, or a second one moves; incline where it goes straight
        down.
      fps: what the container says, right or wrong.
      objects: name to centre where it is first seen, in the order in which they set out.
      sizes_px: name to about its (width, height) in the picture, object 1's along the ramp.
      direction: of the first object.
      ramp: (x1, y1, x2, y2), a line along the surface, the upper end first; None: not seen.
      foot: where the ramp meets the table; None: not seen.
      doubts: what could not be found, one line each.
      first_frames: name to the frame in which it is first seen, of those that come later.
    """

    scenario: str
    fps: float
    objects: dict[str, Point]
    sizes_px: dict[str, Point]
    direction: Direction = "right"
    ramp: tuple[float, float, float, float] | None = None
    foot: Point | None = None
    doubts: tuple[str, ...] = ()
    first_frames: dict[str, int] = field(default_factory=dict)


@in_float64
def propose(
    video: str | Path,
    *,
    on_progress: progress.OnProgress | None = None,
    cancel: progress.CancelFlag | None = None,
) -> Proposal:
    """Looks for the objects that move in a video, for the ramp and its foot.

    What sets out first is object 1; its path gives the ramp's angle, and the bend of the path the
    foot. All of it is a proposal, to be looked at and mended (`label` writes what is right).

    Args:
      video: any video that decodes; a yaml beside it is not read.
      on_progress: called with the stage, the share done (0 to 1) and None.
      cancel: a flag with `is_set`, such as `threading.Event`.

    Raises:
      InputError: the video does not decode, nothing moves in it, or the camera does.
      Cancelled: `cancel` was set.

    Limits: beside an object that is there in the first frame and has texture, others are found if
    they are and have, or if they fly.
    """
    path = Path(video)
    with progress.scope(on_progress, cancel):
        info = decode.probe(path)
        done = itertools.count(1)

        def advance() -> None:
            progress.report("looking for what moves", DETECTED * next(done) / info.frame_count)

        try:
            if info.turns_away:  # what is drawn from such a film moves at its edges
                raise CameraMovesError
            every = find_movers(lambda: decode.frames(path), SPAN_PX, advance=advance)
        except CameraMovesError as error:
            raise InputError(f"{path}: {error}; mark the objects by hand") from None
        movers = [mover for mover in every if mover.flies or not mover.first_frame]
        stay = [mover for mover in movers if not mover.leaves_picture][:2]
        movers = stay or movers[:1] or every[:1]
        if not movers:
            raise InputError(f"{path}: nothing moves in it; mark the objects by hand")
        with progress.part(DETECTED, 1.0):
            return _proposed(path, info.container_fps or 30.0, movers)


def _proposed(path: Path, fps: float, movers: list[Mover]) -> Proposal:
    names = [f"object{i}" for i in range(1, len(movers) + 1)]
    sizes = {name: _size(mover) for name, mover in zip(names, movers, strict=True)}
    objects = {name: mover.point_px for name, mover in zip(names, movers, strict=True)}
    direction: Direction = "right" if movers[0].goes_right else "left"
    later = {n: m.first_frame for n, m in zip(names, movers, strict=True) if m.first_frame}
    if movers[0].flies:
        return Proposal("flight", fps, objects, sizes, direction, first_frames=later)
    doubts: list[str] = []
    for scenario in ("ramp", "incline"):
        seen = {n: objects[n] for n in (names if scenario == "ramp" else names[:1])}
        content = _content(path, scenario, direction, fps, seen, sizes, later)
        try:
            found = measure(check_clip(path.with_suffix(".yaml"), content)).clip
        except InputError as error:
            doubts.append(str(error))
            continue
        turned = _turn(found)
        standing = {**sizes, names[0]: _size(movers[0], turned)}
        found = _with_height(found, sizes[names[0]][1], standing[names[0]][1])
        ramp, foot = _line(found, standing[names[0]])
        assert found.frame_size_px is not None  # of a video
        edge = EDGE_SHARE * found.frame_size_px[0]
        if len(seen) > 1 or foot is None or edge < foot[0] < found.frame_size_px[0] - edge:
            return Proposal(
                scenario, fps, seen, standing, found.direction, ramp, foot, first_frames=later
            )
        # It is stopped at the picture's edge rather than going on along a table.
    return Proposal("ramp", fps, objects, sizes, direction, doubts=(doubts[0],), first_frames=later)


def _content(
    path: Path,
    scenario: str,
    direction: Direction,
    fps: float,
    objects: dict[str, Point],
    sizes: dict[str, Point],
    first_frames: Mapping[str, int],
) -> dict[str, Any]:
    listed = []
    for name, point in objects.items():
        width, height = (side / SCALE for side in sizes[name])
        seen = {"point_px": list(point), "first_frame": first_frames.get(name, 0)}
        listed.append({"name": name, "shape": "box", "size_m": [width, width, height], **seen})
    return {
        "video": path.name,
        "scenario": scenario,
        "fps": fps,
        "ramp_angle_deg": None,
        "direction": direction,
        "pixels_per_metre": SCALE,
        "objects": listed,
    }


def _size(mover: Mover, turned_rad: float = 0.0) -> Point:
    """Width and height, px, of the box that holds its features and is turned in the picture."""
    width, height = np.ptp(mover.places_px @ rotation(turned_rad), axis=0) + 2.0
    return max(float(width), SMALLEST_PX), max(float(height), SMALLEST_PX)


def _turn(clip: Clip) -> float:
    """How an object on the ramp stands in the picture, clockwise, rad."""
    assert clip.ramp_angle_deg is not None  # measured
    return clip.sign * math.radians(clip.ramp_angle_deg)


def _with_height(clip: Clip, before_px: float, now_px: float) -> Clip:
    """The foot where it is if the first object is this high: see `infer_foot`."""
    if clip.origin_px is None:
        return clip
    lower, turned = (before_px - now_px) / 2, _turn(clip)
    x, y = clip.origin_px
    return clip.model_copy(update={"origin_px": (x + lower * math.tan(turned / 2), y - lower)})


def _line(clip: Clip, size: Point) -> tuple[tuple[float, float, float, float], Point | None]:
    """The ramp's surface below the first object, from above it down to the foot, px."""
    right, into = rotation(_turn(clip)).T  # along the ramp, and from the object into it
    down = clip.sign * right
    start = np.asarray(clip.objects[0].point_px) + into * size[1] / 2
    if clip.origin_px is not None:
        foot = np.asarray(clip.origin_px)
        line = _rounded(foot - down * (down @ (foot - start) + size[0]), foot)
        return line, line[2:]
    assert clip.frame_size_px is not None  # of a video
    reach = 0.45 * min(clip.frame_size_px) / max(abs(down))
    return _rounded(start - down * 0.2 * reach, start + down * reach), None


def _rounded(upper: np.ndarray, lower: np.ndarray) -> tuple[float, float, float, float]:
    x1, y1, x2, y2 = (round(float(value), 1) for value in (*upper, *lower))
    return x1, y1, x2, y2

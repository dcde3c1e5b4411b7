"""Tracking a video in two passes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from galileo_jax.tracking.exposure import LEARNT_FRAMES, Exposure
from galileo_jax.tracking.follower import Follower
from galileo_jax.tracking.fragments import Piece, Start, follow_on, keep_apart
from galileo_jax.tracking.motion_compensation import Coding
from galileo_jax.tracking.own_colour import in_own_colours
from galileo_jax.tracking.picture import OpenFrames, Picture, View
from galileo_jax.tracking.poses_to_track import Finished, finished, joined
from galileo_jax.tracking.refiner import Refined, refine_pose, velocities_at
from galileo_jax.tracking.second_opinion import (
    LEAST_SHARE,
    is_lost,
    needs_silhouette,
    with_silhouette,
)
from galileo_jax.tracking.silhouette import paths_of
from galileo_jax.tracking.template import Template, grey, median_template
from galileo_jax.tracking.track import Track


@dataclass(frozen=True)
class Seen:
    """What the first pass has found in a frame."""

    frame: int  # its number
    places_px: tuple[tuple[float, float] | None, ...]  # by object `(x, y)`; None: not found


def track_video(
    open_frames: OpenFrames,
    starts: Sequence[Start],
    times_s: np.ndarray,
    *,
    coding: Coding | None = None,
    advance: Callable[[Seen | None], None] = lambda _: None,
) -> Track:
    """Follows the point of each start through a video.

    First pass: from frame to frame (Lucas-Kanade features, then alignment with the first
    frame's patch), which also shows the exposure time. Then one clean template per object, the
    median of its sharp patches. Second pass: every pose again, by alignment with that template,
    smeared by the motion; the first frame's pose fixes where on the object the point lies.

    Where somebody has put an object right it is looked for around that point. If it looks as it
    did, it is followed on as the same; if not, from a new first frame, whose point is then known
    as well as a click is.

    Args:
      open_frames: gives the frames from the beginning, `[height, width, 3]` uint8, BGR (or
        grey); called for each pass.
      starts: at least one.
      times_s: `[frame]`, increasing, when each was taken.
      coding: how the frames were coded. None: each for itself.
      advance: called after every frame of both passes, of the first one with what it has found.
    """
    clock, starts = in_steps(times_s), in_own_colours(open_frames, starts)
    first = _from_frame_to_frame(open_frames, starts, clock, advance)
    count, flat = first.count, [piece for own in first.pieces for piece in own]
    shares, fits = _in_every_frame(first, open_frames, clock, advance)
    coding = coding or Coding(np.zeros(count, bool))
    done = iter(finished(fits, flat, shares, coding, clock[:count], len(starts) == 1))
    objects = [joined([next(done) for _ in own], count) for own in first.pieces]
    if len(objects) == 1 and needs_silhouette(objects[0], starts[0]):
        # Those of two objects that touch are one, whose middle is neither's.
        objects = [_second_look(objects[0], starts[0], open_frames, clock)]
    names = [field.name for field in fields(Finished)]
    stacked = {name: np.stack([getattr(item, name) for item in objects]) for name in names}
    return Track(
        names=tuple(start.name for start in starts),
        times_s=times_s[:count],
        is_visible=np.isfinite(stacked["angle_rad"]),
        frame_size_px=first.size_px,
        **stacked,
    )


def _second_look(
    found: Finished, start: Start, open_frames: OpenFrames, clock: np.ndarray
) -> Finished:
    """The track with silhouettes, in colour if that shows the object in more frames by a tenth.

    Coders keep colours half as finely as grey.
    """
    best = with_silhouette(found, start, paths_of(lambda: map(grey, open_frames()), clock), clock)
    has_colours = next(iter(open_frames())).ndim == 3
    if not has_colours or (best is not found and not is_lost(best, start)):
        return best
    other = with_silhouette(found, start, paths_of(open_frames, clock), clock)
    seen, more = (int(np.isfinite(one.angle_rad).sum()) for one in (best, other))
    return other if best is found or more > (1 + LEAST_SHARE) * seen else best


@dataclass
class _FirstPass:
    """What following from frame to frame gives."""

    pieces: list[list[Piece]]  # of each start
    exposure: Exposure  # as far as smears show it
    count: int = 0  # of frames
    size_px: tuple[int, int] = (0, 0)  # of the picture


def _from_frame_to_frame(
    open_frames: OpenFrames,
    starts: Sequence[Start],
    clock: np.ndarray,
    advance: Callable[[Seen | None], None],
) -> _FirstPass:
    """The first pass of `track_video`; `clock` in usual steps."""
    first = _FirstPass([[] for _ in starts], Exposure())
    pieces, before = first.pieces, None
    for index, frame in enumerate(open_frames()):
        now = _pictures(frame, {start.view for start in starts})
        used = [k for k, start in enumerate(starts) if start.uses(index)]
        for k in used:
            beside = [own[-1].follower for i, own in enumerate(pieces) if own and i != k]
            step = clock[index] - clock[index - 1] if index else 1.0
            follow_on(pieces[k], starts[k], index, before, now, first.exposure, beside, step)
        keep_apart([pieces[k][-1] for k in used], index, before, now)
        before = now
        first.count, first.size_px = index + 1, next(iter(now.values())).size_px
        advance(Seen(index, tuple(_place(own, index) for own in pieces)))
    return first


def _in_every_frame(
    first: _FirstPass,
    open_frames: OpenFrames,
    clock: np.ndarray,
    advance: Callable[[Seen | None], None],
) -> tuple[list[float], list[list[Refined | None]]]:
    """The second pass: of each piece its shares of a frame's time, and its pose in each frame."""
    looks = [
        _Look(piece, piece.poses(first.count), _final_template(piece.follower))
        for own in first.pieces
        for piece in own
    ]
    shares = _learnt(first, looks, open_frames, clock)
    fits: list[list[Refined | None]] = [[] for _ in looks]
    for index, frame in zip(range(first.count), open_frames(), strict=False):
        now = _pictures(frame, {look.piece.view for look in looks})
        for look, share, found in zip(looks, shares, fits, strict=True):
            fit, pose = None, look.poses[index]
            if np.isfinite(pose[0]):
                velocities = look.piece.velocities(look.poses, index, clock)
                fit = refine_pose(now[look.piece.view], look.template, pose, velocities, share)
            found.append(fit)
        advance(None)
    return shares, fits


class _Look(NamedTuple):
    """A piece after the first pass: its poses `[frame, 3]`, and its final template."""

    piece: Piece
    poses: np.ndarray
    template: Template


def _final_template(follower: Follower) -> Template:
    """The median of an object's sharp patches; smeared as its first frame if there are none."""
    own = follower.template
    return replace(median_template(follower.patches, own), moved=own.moved)


def _learnt(
    first: _FirstPass, looks: Sequence[_Look], open_frames: OpenFrames, clock: np.ndarray
) -> list[float]:
    """The open share of a frame's time for each piece, where the first pass has not learned it.

    What was smeared in its first frame shows it only once there is a sharp look of it. Where there
    never is, the share is that by which the pictures are smeared more than the template.
    """
    own = {k: Exposure() for k, look in enumerate(looks) if not look.template.is_sharp}
    is_learnt = first.exposure.frames >= LEARNT_FRAMES
    asked = [k for k in range(len(looks)) if k in own or not is_learnt]
    as_sharp = {k: replace(looks[k].template, moved=np.zeros(3)) for k in asked}
    if asked:
        for index, frame in zip(range(first.count), open_frames(), strict=False):
            now = _pictures(frame, {looks[k].piece.view for k in asked})
            for k in asked:
                poses, view = looks[k].poses, looks[k].piece.view
                if np.isfinite(poses[index, 0]):
                    velocity = velocities_at(poses, index, clock).mean
                    into = own.get(k, first.exposure)
                    into.add(now[view], as_sharp[k], poses[index], velocity)
    return [own.get(k, first.exposure).share for k in range(len(looks))]


def _pictures(frame: np.ndarray, views: set[View]) -> dict[View, Picture]:
    """A frame as it is looked at."""
    return {view: Picture(view(frame)) for view in views}


def in_steps(times_s: np.ndarray) -> np.ndarray:
    """`[frame]`: when each frame was taken, in units of the usual step from one to the next."""
    steps = np.diff(times_s)
    # Rounding of times is no unevenness.
    return np.append(0.0, np.cumsum(np.round(steps / np.median(steps), 6)) if len(steps) else [])


def _place(pieces: list[Piece], index: int) -> tuple[float, float] | None:
    """Where an object was found in a frame; None: nowhere."""
    if not pieces or not np.isfinite(pose := pieces[-1].poses(index + 1)[-1])[0]:
        return None
    return float(pose[0]), float(pose[1])

"""Where the texture of an object loses it: the path of its silhouette instead."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.numerics.least_squares import least_squares, polynomial
from galileo_jax.numerics.runs import stretches
from galileo_jax.tracking.fragments import Start
from galileo_jax.tracking.noise import motion_variance, sudden
from galileo_jax.tracking.pose import length
from galileo_jax.tracking.poses_to_track import Finished
from galileo_jax.tracking.refiner import velocities_at
from galileo_jax.tracking.silhouette import MOST_MISSED, Path, way_px

LOST_SHARE = 0.05
"""Of the frames in which an object is looked for: missed in more, its silhouette is."""
TURNED_RAD = 0.5  # what is round and turns by more may be followed by its marks, not its middle
LEAST_FRAMES, LEAST_SHARE = 3, 0.1  # more that a silhouette has to show; of those that are known
SAME_FRAMES, SAME_PX, SAME_SIZE = 5, 0.5, 0.05
"""Middles of texture and silhouette are a fixed distance apart if over so many frames they agree to
this, in pixels or by the object's size."""
INSIDE, BESIDE = 0.5, 2.0
"""A silhouette is the object's if its middle is within this share of its size of where the texture
is, or, where little is seen of that, of the mark; or if it begins within so many sizes of where
that was last seen."""
STAYS_PX, FARTHER = 20.0, 3.0
"""What goes less far may be what is behind a smeared object: it is if a silhouette sets out from
there and goes so many times as far."""
ON_OBJECT = 0.3
"""Sd per axis of a point somewhere on an object, by its size: of a square 1 / sqrt(12)."""
OUTLINE_AREA = (0.3, 6.0)  # a silhouette's area by that of the outline: a smear makes it larger
EDGE_PX = 0.03  # sd that sampling a sharp edge with pixels gives the middle of a silhouette
SMOOTH_DEGREE = 3  # of time: weight, and a drag
USUAL_SHARE = 0.5  # of a frame's time for which the shutter may be open
ARM = 0.25  # pixels that come and go at the rim are about this share of the size from the middle


def needs_silhouette(found: Finished, start: Start) -> bool:
    """Whether an object is lost for a while, or may be followed by its marks."""
    if start.corrections:
        return False  # somebody has looked at it
    seen = np.isfinite(found.angle_rad)
    return is_lost(found, start) or _turns(found, start) or _stays(found, seen)


def is_lost(found: Finished, start: Start) -> bool:
    """Whether an object is missed in many of the frames in which it is looked for."""
    wanted = np.array([start.uses(index) for index in range(len(found.angle_rad))])
    missed = wanted & ~np.isfinite(found.angle_rad)
    return bool(missed.sum() > LOST_SHARE * wanted.sum())


def _stays(found: Finished, seen: Bool[np.ndarray, " frame"]) -> bool:
    """Whether what is followed hardly moves."""
    return bool(seen.any()) and way_px(found.position_px[seen]) < STAYS_PX


def with_silhouette(
    found: Finished, start: Start, paths: Sequence[Path], clock: Float[np.ndarray, " frame"]
) -> Finished:
    """The object's track, where its silhouette shows more than its texture from that.

    Where it is known how far the two are apart, both are used, and the point stays the followed
    one, but for what is round, whose middle it becomes. Otherwise it becomes the silhouette's
    middle. If a smooth path leads to that from where the texture was last seen (it was held until
    then, say, and its silhouette was one with the hand's), both are used all the same: how far
    they are apart is then an unknown shift of whichever goes less far. Where the two go together,
    and now nearer, now farther apart, that is an error of either, as far as its own path is rough:
    a point on a ball goes round with it. Of a texture that hardly moves while a silhouette sets out
    from it, the first frame alone counts: it is of the scene behind.
    """
    seen = np.isfinite(found.angle_rad)
    if _stays(found, seen):
        first, way = np.arange(len(seen)) == int(seen.argmax()), way_px(found.position_px[seen])
        far = [path for path in paths if path.way_px > FARTHER * way]
        if any(_is_own(path, found.position_px, first, start) for path in far):
            seen = first
    own = [path for path in paths if _is_own(path, found.position_px, seen, start)]
    if not own:
        return found
    path = max(own, key=lambda one: one.way_px)
    place = np.full_like(found.position_px, np.nan)
    place[path.frames] = path.places_px
    place[[not start.uses(index) for index in range(len(place))]] = np.nan
    shown = np.isfinite(place[:, 0])
    both = shown & seen
    if _turns(found, start):
        found = _at_the_middle(found, place, both)
    apart = found.position_px[both] - place[both]
    middle = np.median(apart, axis=0) if both.any() else np.zeros(2)
    size = float(np.median(path.sizes_px))
    scatter = np.median(np.abs(apart - middle)) if both.any() else np.inf
    is_fixed = both.sum() >= SAME_FRAMES and scatter < max(SAME_PX, SAME_SIZE * size)
    is_more = (shown & ~seen).sum() >= max(LEAST_FRAMES, LEAST_SHARE * seen.sum())
    if not is_more and not (_turns(found, start) and _is_smoother(found, place, both, clock)):
        return found
    if not is_fixed and way_px(place[shown]) < way_px(found.position_px[seen]):
        return found
    kept, slow_px, apart_px = np.zeros_like(seen), _slow_px(path), 0.0
    for run in stretches(seen & ~shown):
        kept[run] = run.stop - run.start >= SAME_FRAMES
    if not is_fixed:
        kept[path.frames[0] :] = False
        last, middle = _led_on(found.position_px, kept, path, size, clock)
        kept[last + 1 :] = False
        if kept.any():
            apart_px = ON_OBJECT * size
        is_told = both.sum() >= SAME_FRAMES
        ways = [way_px(one[both]) for one in (place, found.position_px)] if is_told else [0.0]
        if min(ways) > size > np.ptp(ways):  # they go together, and one of them is off
            rough, other = (
                _off_smooth_px(one[both], clock[both]) for one in (place, found.position_px)
            )
            slow_px = float(np.hypot(slow_px, 1.4826 * scatter * rough / np.hypot(rough, other)))
    covariance = np.where(kept[:, None, None], found.covariance_px2, _covariance(place, clock))
    if start.outline.is_round or not is_fixed:
        place = np.where(kept[:, None], found.position_px - middle, place)
    else:
        place = np.where(kept[:, None], found.position_px, place + middle)
    used = np.isfinite(place[:, 0])
    nothing = np.where(used, 0.0, np.nan)
    shifts_px = np.tile(nothing[:, None, None], (1, *found.shifts_px.shape[1:]))
    ways = [way_px(place[used & each]) if (used & each).any() else 0.0 for each in (kept, ~kept)]
    is_shifted = kept if ways[0] < ways[1] else ~kept
    shifts_px[used & ~kept, :2] = slow_px * np.eye(2)
    common = nothing[:, None, None] + np.multiply.outer(apart_px**2 * is_shifted, np.eye(2))
    return Finished(place, covariance + common, common, shifts_px, nothing)


def _at_the_middle(
    found: Finished, place: Float[np.ndarray, "frame 2"], both: Bool[np.ndarray, " frame"]
) -> Finished:
    """The track of the middle of what turns, by that of a point that goes round it.

        point = middle + R(angle) d,    middle = silhouette's + c

    where d and c, one each, leave less than SAME_PX; else as it was found.
    """
    if both.sum() < SAME_FRAMES:
        return found
    c, s = np.cos(found.angle_rad), np.sin(found.angle_rad)
    one, none = np.ones_like(c), np.zeros_like(c)
    design = np.stack([np.stack([c, -s, one, none], -1), np.stack([s, c, none, one], -1)], 1)
    apart = (found.position_px - place)[both].reshape(-1)
    fit = least_squares(design[both].reshape(-1, 4), apart)
    if np.median(np.abs(fit.left)) > SAME_PX:
        return found
    return replace(found, position_px=found.position_px - design[..., :2] @ fit.solution[:2])


def _led_on(
    texture_px: Float[np.ndarray, "frame 2"],
    kept: Bool[np.ndarray, " frame"],
    path: Path,
    size_px: float,
    clock: Float[np.ndarray, " frame"],
) -> tuple[int, Float[np.ndarray, "2"]]:
    """The last frame by texture from which a path leads to the silhouette's, and how far apart.

    -1: there is none. What is about to be lost is no longer where its texture seems to be, so
    SAME_FRAMES of it have to be as smooth as a parabola. With d the distance, and on the texture's
    side alone, one parabola goes through these and the silhouette's first,

        x(t) = x_0 + v t + a t^2 / 2 + d
    """
    after = np.array(path.frames[:SAME_FRAMES])
    for last in np.flatnonzero(kept)[::-1]:
        own = np.arange(last - SAME_FRAMES + 1, last + 1)
        if own[0] < 0 or not kept[own].all():
            continue
        left = polynomial(clock[own] - clock[last], texture_px[own], 2).left
        if np.sum(left**2) > (SAME_FRAMES - 3) * SAME_PX**2:
            continue
        frames = np.concatenate([own, after])
        design = np.column_stack([np.vander(clock[frames] - clock[last], 3), frames <= last])
        places = np.concatenate([texture_px[own], path.places_px[: len(after)]])
        apart = least_squares(design, places).solution[-1]
        return (int(last), apart) if length(apart) < size_px else (-1, np.zeros(2))
    return -1, np.zeros(2)


def _is_own(
    path: Path, position_px: np.ndarray, seen: Bool[np.ndarray, " frame"], start: Start
) -> bool:
    """Whether a path of silhouettes is the object's: it moves, and meets the texture's path."""
    place, frames = path.places_px, np.array(path.frames)
    size = float(np.median(path.sizes_px))
    if way_px(place) < size or len(frames) < SAME_FRAMES or not seen.any():
        return False
    if start.outline.size_px is not None:
        low, high = np.array(OUTLINE_AREA) * np.prod(start.outline.size_px)
        if not low < size**2 < high:
            return False
    both = seen[frames]
    if both.sum() >= SAME_FRAMES:
        off = np.hypot(*(place[both] - position_px[frames[both]]).T)
        return bool(np.median(off / path.sizes_px[both]) < INSIDE)
    if start.first_frame in path.frames:  # where it was marked
        at = path.frames.index(start.first_frame)
        if length(place[at] - start.point_px) < INSIDE * path.sizes_px[at]:
            return True
    known = np.flatnonzero(seen)
    nearest = int(known[np.argmin(np.abs(known - frames[0]))])
    is_beside = length(place[0] - position_px[nearest]) < BESIDE * path.sizes_px[0]
    return bool(is_beside and abs(frames[0] - nearest) <= MOST_MISSED)


def _turns(found: Finished, start: Start) -> bool:
    seen = np.isfinite(found.angle_rad)
    return start.outline.is_round and bool(np.ptp(found.angle_rad[seen]) > TURNED_RAD)


def _is_smoother(
    found: Finished, place: np.ndarray, both: Bool[np.ndarray, " frame"], clock: np.ndarray
) -> bool:
    """Whether the silhouette's path scatters less about a smooth one than the texture's."""
    none = np.zeros((len(place), 2, 2))
    paths = [(np.where(both[:, None], each, np.nan), none) for each in (place, found.position_px)]
    silhouette, texture = (float(motion_variance([one], clock).sum()) for one in paths)
    return silhouette < texture


def _off_smooth_px(place: np.ndarray, clock: np.ndarray) -> float:
    """What the smoothest path that bends as motions do leaves of one, px, root mean square."""
    since = (clock - clock.mean()) / np.ptp(clock)
    left = polynomial(since, place, SMOOTH_DEGREE).left
    spare = max(len(place) - SMOOTH_DEGREE - 1, 1)
    return float(np.sqrt(np.sum(left**2) / (2 * spare)) + EDGE_PX)


def _covariance(place: np.ndarray, clock: np.ndarray) -> Float[np.ndarray, "frame 2 2"]:
    """Of a silhouette's middle from frame to frame: its scatter, and blows within an exposure.

    A picture shows the mean place during the exposure e. A change dv of the velocity within it
    shifts that by dv e / 8 at most.
    """
    stated = np.broadcast_to(EDGE_PX**2 * np.eye(2), (len(place), 2, 2))
    jumps = np.zeros((len(place), 2))
    for index in np.flatnonzero(np.isfinite(place[:, 0])):
        jumps[index] = velocities_at(place, int(index), clock).jump
    unknown = np.sum((USUAL_SHARE / 8 * sudden(jumps)) ** 2, axis=1)
    scatter = np.diag(motion_variance([(place, stated)], clock))
    return stated + scatter + unknown[:, None, None] * np.eye(2)


def _slow_px(path: Path) -> float:
    """Standard deviation per axis of errors that follow each other, px.

    What is behind an object lets pixels at its rim come and go as it passes. So its area changes
    otherwise than with its distance (a parabola in time) and its smear (its speed).
    """
    area = np.array([part.area_px2 for part in path.parts])
    since = np.linspace(-1, 1, len(area))
    speed = np.hypot(*np.gradient(path.places_px, path.clock, axis=0).T)
    left = least_squares(np.column_stack([np.vander(since, 3), speed]), area).left
    # Not of the frame in which it is thrown back, whose smear is folded.
    spread = 1.4826 * np.median(np.abs(left)) * np.sqrt(len(area) / (len(area) - 4))
    return float(ARM * spread / np.sqrt(np.median(area)))

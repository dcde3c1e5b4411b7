"""Finding the objects of a video without being told where they are: what moves, and when first.

Features of the first frame are followed through the whole video. Those that set out together,
from places close to each other, and keep going the same way are one thing. A thing that leaves
the picture is a hand; of the others the first to move is object 1. Before it comes what flies: a
silhouette that goes evenly to the side and falls evenly faster, as nothing does that is held or
stands on something. Where no features move and nothing flies, it is the silhouette that goes
farthest.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import cv2
import numpy as np
from scipy.sparse.csgraph import connected_components

from galileo_jax.numerics.least_squares import polynomial
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.features import PYRAMID_LEVELS, follow_points, rigid_motion
from galileo_jax.tracking.picture import OpenFrames, some_frames
from galileo_jax.tracking.pose import corners, patch_at, rotation
from galileo_jax.tracking.silhouette import Path, differences, paths_of
from galileo_jax.tracking.template import Outline, grey

MAX_FEATURES = 1200
WINDOW_PX = 13
MOVED_PX = 3.0  # a feature that is this far from where it began has moved; noise reaches 1 px
SAME_ONSET_FRAMES = 3
SAME_WAY_PX = 3.0  # features of one thing are displaced alike to this, while they turn little
NEARER = 0.05  # of a size in the picture: it may change by this, as the thing comes nearer
MIN_FEATURES = 5
LOOK_AHEAD_FRAMES = 3
MOST = 0.8
"""Of all features, and of the picture's sides: where so many move alike, the camera moves."""
BORDER_SHARE = 0.03  # share of the frame's width within which a thing counts as at the border
RIM_POINTS = 64  # at which a disc's edge is looked at
LEAST_OUTLINES = 3  # of a thing that must be seen
LEAST_SEEN = 6  # frames in which a silhouette is followed: fewer may be linked by chance
STRAY, LEAST_WAY = 0.03, 3.0
"""Of its way, by which what flies is off a parabola in time, and by more of which that is bent; how
many of its sizes it flies at least."""


@dataclass(frozen=True)
class Mover:
    """A thing that moves."""

    # its middle in the first frame in which it is seen, `(x, y)`
    point_px: tuple[float, float]
    onset_frame: int  # when it had moved by `MOVED_PX`
    num_features: int  # how many features agree on it; 0 of a silhouette
    leaves_picture: bool  # whether its features were last seen going over the border
    # `[corner, 2]`, of its outline in that frame; where none was seen, its features
    places_px: np.ndarray
    # `[frame, 2]`, how far it has gone since; NaN where it is not seen
    way_px: np.ndarray
    goes_right: bool = True  # whether its features were last seen to the right of where they began
    first_frame: int = 0  # in which it is seen
    flies: bool = False  # whether nothing but its weight moves it


class CameraMovesError(InputError):
    """Nearly all features of a picture move alike."""

    def __init__(self) -> None:
        super().__init__("the whole picture moves alike, as it does where the camera moves")


def find_movers(
    open_frames: OpenFrames,
    span_px: float,
    *,
    axes_angle_rad: float = 0.0,
    may_fly: bool = True,
    outlined: bool = True,
    wanted: int = 1,
    advance: Callable[[], None] = lambda: None,
) -> list[Mover]:
    """The things that move: what flies, what stays in the picture, the others; each by onset.

    Args:
      open_frames: gives the frames; called up to three times.
      span_px: about the size of an object; features farther apart are linked by others only.
      axes_angle_rad: how the objects' sides are turned in the image (the ramp's angle).
      may_fly: whether something may, which is looked for then.
      outlined: whether outlines of what has features are looked for.
      wanted: how many things are asked for, one at least; where fewer have features, or fly, the
        silhouettes that go farthest are the others.
      advance: called after every frame.

    Raises:
      CameraMovesError: the whole picture moves, so that nothing says what is in motion.

    Limits: beside as many things with texture as are wanted, others are found if they fly.
    """
    path, size_px = _feature_paths(open_frames, advance)
    moved = np.linalg.norm(path - path[:1], axis=2) > MOVED_PX
    # Moved for good, not for a frame: an occluded feature jumps and is lost.
    settled = moved & np.roll(moved, -1, axis=0) & np.roll(moved, -2, axis=0)
    settled[-2:] = False
    onset = np.where(settled.any(axis=0), settled.argmax(axis=0), -1)
    if _whole_picture_moves(path, onset, size_px):
        raise CameraMovesError
    groups = _groups(path, onset, span_px)
    looks_on = may_fly or len(groups) < max(wanted, 1)
    some = some_frames(open_frames, len(path)) if looks_on or outlined else {}
    ways = paths_of(open_frames, np.arange(len(path)), some) if looks_on else []
    ways = [one for one in ways if len(one.parts) >= LEAST_SEEN]
    ways = [one for one in ways if not any(_is_same(one, path[:, members]) for members in groups)]
    flying = [one for one in ways if _flies(one)]
    movers, margin = [], BORDER_SHARE * size_px[0]
    labels = differences(some) if outlined else {}
    for members, places in _with_outlines(path, onset, groups, labels):
        began, last = path[0, members], np.array([_last_seen(path[:, i]) for i in members])
        beyond = (last < margin) | (last > np.array(size_px) - 1 - margin)
        movers.append(
            Mover(
                point_px=_middle(places, axes_angle_rad),
                onset_frame=int(np.median(onset[members])),
                num_features=len(members),
                leaves_picture=bool(np.mean(beyond.any(axis=1)) > 0.3),
                places_px=places,
                way_px=_medians(path[:, members] - began),
                goes_right=bool(np.median(last[:, 0] - began[:, 0]) >= 0),
            )
        )
    others = [one for one in ways if not _flies(one) and one.way_px >= one.parts[0].size_px]
    others = sorted(others, key=lambda one: -one.way_px)
    lacking = max(max(wanted, 1) - len(movers) - len(flying), 0)
    movers += [_silhouette(one, len(path)) for one in (*flying, *others[:lacking])]
    return sorted(movers, key=lambda one: (not one.flies, one.leaves_picture, one.onset_frame))


def _silhouette(path: Path, num_frames: int) -> Mover:
    first, frame = path.parts[0], path.frames[0]
    x, y = first.centre_px
    goes_right = bool(path.parts[-1].centre_px[0] >= x)
    corners = np.stack([first.low_px, first.high_px]).astype(float)
    way = np.full((num_frames, 2), np.nan)
    way[path.frames] = path.places_px - path.places_px[0]
    point = (float(x), float(y))
    return Mover(point, frame, 0, False, corners, way, goes_right, frame, _flies(path))


def _flies(path: Path) -> bool:
    """Whether a silhouette moves as what is thrown or dropped: evenly across, ever faster down."""
    place, way = path.places_px, path.way_px
    if way < LEAST_WAY * float(np.median(path.sizes_px)):
        return False
    since = 2 * (np.array(path.clock) - path.clock[0]) / (path.clock[-1] - path.clock[0]) - 1
    down = polynomial(since, place[:, 1], 2)
    left = np.stack([polynomial(since, place[:, 0], 1).left, down.left])
    return bool(np.abs(left).max() < STRAY * way and down.solution[0] > STRAY * way)


def _is_same(path: Path, places: np.ndarray) -> bool:
    """Whether a silhouette is the thing of features `[frame, feature, 2]`, while these are seen."""
    off = np.hypot(*(_medians(places)[path.frames] - path.places_px).T)
    off = off[np.isfinite(off)]
    return bool(off.size and np.median(off) < np.median(path.sizes_px))


def _with_outlines(
    path: np.ndarray, onset: np.ndarray, groups: list[np.ndarray], labels: Mapping[int, np.ndarray]
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Groups of features, `[member]`, with the outlines of their things, `[corner, 2]`.

    Those that set out with a thing from within its outline are of it, unless they go away from it:
    a hand that lets go sets out with what it held.
    """
    groups = sorted(groups, key=len, reverse=True)
    since = np.array([np.median(onset[members]) for members in groups])
    middles = np.array([_medians(path[:, members]) for members in groups])
    found: dict[int, tuple[np.ndarray, np.ndarray]] = {}  # by the number of its first group
    for own, members in enumerate(groups):
        together = np.abs(since - since[own]) <= SAME_ONSET_FRAMES
        for first, (others, outline) in found.items():
            apart = np.linalg.norm(middles[own] - middles[first], axis=1)
            stays = not (apart > np.hypot(*np.ptp(outline, axis=0))).any()  # NaN: not seen
            if together[first] and stays and _holds(outline, path[0, members]):
                found[first] = np.concatenate([others, members]), outline
                break
        else:
            outline = _outlined(path[:, members], middles[~together], labels)
            found[own] = members, outline
    return list(found.values())


def _outlined(
    places: np.ndarray, others: np.ndarray, labels: Mapping[int, np.ndarray]
) -> np.ndarray:
    """The outline of a thing in the first frame, `[corner, 2]`: of what it has left, or come to.

    Features may be all on one side of it, as on a box with a label. Where it has gone all its
    length, it is one of the parts in which the picture differs from the first, at either end of its
    way; but not where another thing is then, or was at first. Without a part that holds its
    features: these.

    `places`: of its features `[frame, feature, 2]`. `others`: of other things `[thing, frame, 2]`.
    `labels`: by frame, of the parts, `[height, width]`; 0: as in the first.
    """
    began = places[0]
    found: dict[str, list[np.ndarray]] = {"left": [], "reached": []}
    for frame, parts in labels.items():
        now = places[frame]
        seen = np.isfinite(now[:, 0])
        motion = rigid_motion(now[seen], began[seen])
        if motion is None:
            continue
        turn, shift = rotation(motion[0]).T, motion[1]
        off = np.median(np.linalg.norm(now[seen] @ turn + shift - began[seen], axis=1))
        left, reached = (_part_at(parts, each[seen]) for each in (began, now))
        for kind, end, part in (("left", began[seen], left), ("reached", now[seen], reached)):
            if not part or left == reached or (kind == "reached" and off > SAME_WAY_PX):
                continue
            hull = _hull_of(parts == part)
            apart = np.linalg.norm(others[:, [0, frame]] - np.median(end, axis=0), axis=-1)
            outline = hull if kind == "left" else hull @ turn + shift
            is_alone = not (apart < np.hypot(*np.ptp(hull, axis=0))).any()
            is_whole = (hull > 1).all() and (hull < np.array(parts.shape[::-1]) - 2).all()
            if is_alone and is_whole and _holds(outline, began):
                # Its features are on it, also where it looks like what is behind.
                found[kind].append(_hull(np.concatenate([outline, began])))
    if len(found["left"]) + len(found["reached"]) < LEAST_OUTLINES:
        return began
    # What nobody follows makes some of them larger: a hand that held it, in all that show what has
    # been left, or a thing that it has met, in those that show where it has come to.
    return _small([_small(outlines) for outlines in found.values() if outlines], 0.0)


def _small(outlines: Sequence[np.ndarray], share: float = 0.25) -> np.ndarray:
    """Of outlines that which so many of them are smaller than."""
    areas = [cv2.contourArea(outline.astype(np.float32)) for outline in outlines]
    return outlines[int(np.argsort(areas)[int(share * len(areas))])]


def _medians(places: np.ndarray) -> np.ndarray:
    """Of features `[frame, feature, 2]` those that are seen, `[frame, 2]`; NaN where none is."""
    found = np.full((len(places), 2), np.nan)
    seen = np.isfinite(places[..., 0]).any(axis=1)
    found[seen] = np.nanmedian(places[seen], axis=1)
    return found


def _part_at(parts: np.ndarray, places: np.ndarray) -> int:
    """The part in which most of some places are; 0: none, as where most are at the border."""
    height, width = parts.shape
    x, y = np.clip(np.round(places).astype(int), 0, (width - 1, height - 1)).T
    return int(np.argmax(np.bincount(parts[y, x]))) if len(places) else 0


def _hull_of(mask: np.ndarray) -> np.ndarray:
    """The convex polygon round a part, `[corner, 2]`, as far inside as its outermost features.

    That is two pixels: smoothing adds one, and features are found on the inner side of an edge.
    """
    less = cv2.erode(mask.astype(np.uint8), np.ones((5, 5), np.uint8))
    return _hull(cv2.findNonZero(less if less.any() else mask.astype(np.uint8)))


def _hull(points: np.ndarray) -> np.ndarray:
    """The corners of the convex polygon round points, `[corner, 2]`."""
    return cv2.convexHull(points.astype(np.float32)).reshape(-1, 2).astype(float)


def _holds(outline: np.ndarray, places: np.ndarray) -> bool:
    """Whether most of some places are in an outline, or next to it."""
    hull = _hull(outline).astype(np.float32)
    inside = [cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in places]
    return bool(np.mean(np.array(inside) > -SAME_WAY_PX) > MOST)


def _whole_picture_moves(path: np.ndarray, onset: np.ndarray, size_px: tuple[int, int]) -> bool:
    """Whether nearly all features, all over the picture, go the same way at the same time."""
    moving = np.flatnonzero(onset >= 0)
    if len(moving) < max(MIN_FEATURES, MOST * len(onset)):
        return False
    # The middle of them: features at the border are lost, or found, by chance.
    low, high = np.quantile(path[0, moving], ((1 - MOST) / 4, (3 + MOST) / 4), axis=0)
    if (high - low < (MOST - 0.1) * np.array(size_px)).any():
        return False
    later = min(int(np.median(onset[moving])) + LOOK_AHEAD_FRAMES, len(path) - 1)
    way = path[later, moving] - path[0, moving]
    way = way[np.isfinite(way).all(axis=1)]
    if len(way) < MIN_FEATURES:
        return False
    return bool(np.mean(np.linalg.norm(way - np.median(way, axis=0), axis=1) < SAME_WAY_PX) > MOST)


def _feature_paths(
    open_frames: OpenFrames, advance: Callable[[], None]
) -> tuple[np.ndarray, tuple[int, int]]:
    """Places `[frame, feature, 2]` of the first frame's features, NaN once lost; frame size."""
    before: np.ndarray | None = None
    path: list[np.ndarray] = []
    size_px = (0, 0)
    for frame in open_frames():
        image = grey(frame)
        advance()
        if before is None:
            found = cv2.goodFeaturesToTrack(image, MAX_FEATURES, 0.02, 3)
            path.append(np.empty((0, 2), np.float32) if found is None else found.reshape(-1, 2))
            size_px = (image.shape[1], image.shape[0])
        else:
            path.append(_followed(before, image, path[-1]))
        before = image
    return np.stack(path), size_px


def _followed(before: np.ndarray, after: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Places of the features in the next frame; NaN where lost.

    What stands still is looked for without a pyramid first: on its upper levels something fast
    passing by would carry it away.
    """
    result = np.full_like(places, np.nan)
    for levels in (0, PYRAMID_LEVELS):
        alive = np.flatnonzero(np.isfinite(places[:, 0]) & ~np.isfinite(result[:, 0]))
        if not len(alive):
            break
        moved, is_good = follow_points(before, after, places[alive], WINDOW_PX, levels)
        result[alive[is_good]] = moved[is_good]
    return result


def _groups(path: np.ndarray, onset: np.ndarray, span_px: float) -> list[np.ndarray]:
    """Features of one thing each: they began close together, set out together, went the same way.

    Groups are joined where they are parts of one thing, whose plain middle has no features: parts
    set out together from places less than 2 `span_px` apart, and keep their distance.
    """
    moving = np.flatnonzero(onset >= 0)
    later = np.minimum(onset[moving] + LOOK_AHEAD_FRAMES, len(path) - 1)
    began = path[0, moving]
    near = np.linalg.norm(began[:, None] - began, axis=2) < span_px / 2
    together = np.abs(onset[moving, None] - onset[moving]) <= SAME_ONSET_FRAMES
    way = path[later[:, None], moving] - began  # [whose frame, feature, axis]
    own = way[np.arange(len(moving)), np.arange(len(moving))]
    alike = np.linalg.norm(way - own[:, None], axis=2) < SAME_WAY_PX  # False where lost
    count, label = connected_components(near & together & alike, directed=False)
    groups = [moving[label == k] for k in range(count)]
    whole: list[np.ndarray] = []
    for one in sorted(groups, key=len, reverse=True):
        parts = whole
        while mine := [part for part in parts if _is_one_thing(path, onset, part, one, span_px)]:
            parts = [part for part in parts if all(part is not other for other in mine)]
            one = np.sort(np.concatenate([one, *mine]))
        whole = [*parts, one]
    return [group for group in whole if len(group) >= MIN_FEATURES]


def _is_one_thing(
    path: np.ndarray, onset: np.ndarray, first: np.ndarray, second: np.ndarray, span_px: float
) -> bool:
    """Whether the features of two groups go alike for as long as they are seen together."""
    if abs(np.median(onset[first]) - np.median(onset[second])) > SAME_ONSET_FRAMES:
        return False
    one, other = path[:, first][:, :, None], path[:, second][:, None]
    apart = np.linalg.norm(one - other, axis=3)  # [frame, of the first, of the second]
    if apart[0].min() > 2 * span_px:
        return False
    # Most of them: a feature at the border of a thing may hold on to what is behind.
    change = np.nanmax(abs(apart - apart[0]), axis=0)
    gone = np.linalg.norm(path[:, first] - path[0, first], axis=2)[:, :, None]
    way = np.nanmax(np.where(np.isfinite(apart), gone, 0.0), axis=0)
    is_far = way > SAME_WAY_PX + apart[0] / 2
    is_alike = change < SAME_WAY_PX + NEARER * apart[0]
    return bool(np.mean(is_far & is_alike) > 0.5)


def _last_seen(path: np.ndarray) -> np.ndarray:
    """The last place of a feature, one frame carried on."""
    seen = np.flatnonzero(np.isfinite(path[:, 0]))
    last = path[seen[-1]]
    return last if len(seen) < 2 else 2 * last - path[seen[-2]]


def _middle(places: np.ndarray, angle_rad: float) -> tuple[float, float]:
    """The middle of the smallest rectangle, with sides along the axes, around `places`."""
    low, high = corners(places, angle_rad)
    x, y = rotation(angle_rad) @ ((low + high) / 2)
    return float(x), float(y)


def fit_outline(image: np.ndarray, places: np.ndarray, outline: Outline) -> tuple[float, float]:
    """The centre of the rectangle or disc of known size that holds `places` and has sharp sides.

    Features on one side of an object may be missing (something touched it as it set out, or what
    rolls turns them away), so the middle of those found can be several pixels off. The outline is
    shifted, along its own axes, as far as the features let it, to where the grey image changes most
    across its sides.
    """
    assert outline.size_px is not None
    size = np.array(outline.size_px)
    turn = rotation(outline.angle_rad)
    low, high = corners(places, outline.angle_rad)
    middle = (low + high) / 2
    slack = np.maximum((size - (high - low)) / 2, 0) + 1.5
    radius = int(np.ceil(size.max() / 2 + slack.max())) + 2
    patch = patch_at(image, np.array([*(turn @ middle), outline.angle_rad]), radius)
    patch = cv2.GaussianBlur(patch, (0, 0), 0.8)
    across = np.abs(cv2.Sobel(patch, cv2.CV_32F, 1, 0)), np.abs(cv2.Sobel(patch, cv2.CV_32F, 0, 1))

    around = np.linspace(0, 2 * np.pi, RIM_POINTS, endpoint=False)
    rim = np.stack([np.cos(around), np.sin(around)])

    def sharpness(shift: np.ndarray) -> float:
        if outline.is_round:
            x, y = np.round(radius + shift[:, None] + rim * size[:, None] / 2).astype(int)
            return float((across[0][y, x] * abs(rim[0]) + across[1][y, x] * abs(rim[1])).mean())
        left, top = np.round(radius + shift - size / 2).astype(int)
        right, bottom = np.round(radius + shift + size / 2).astype(int)
        sides = [across[0][top:bottom, x] for x in (left, right)]
        sides += [across[1][y, left:right] for y in (top, bottom)]
        return float(np.mean([side.mean() for side in sides]))

    x, y = (np.arange(-most, most + 0.5, 0.5) for most in slack)
    best = max((np.array(shift) for shift in product(x, y)), key=sharpness)
    x, y = turn @ (middle + best)
    return float(x), float(y)

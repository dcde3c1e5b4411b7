"""A second opinion on where an object is: what differs from the scene without it.

A camera that stands still shows the same scene all the time but for what moves in it:

    scene = median over the film          silhouette = |picture - scene| > noise, in any colour

Connected parts of it are linked from frame to frame to paths. Their centres do not need texture,
are not carried along by marks that turn, and are the mean place of what is smeared; but nothing is
known of a turn, and what touches another moving thing is one part with it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from jaxtyping import Float

from galileo_jax.numerics.least_squares import polynomial
from galileo_jax.tracking.picture import OpenFrames, some_frames
from galileo_jax.tracking.pose import length

NOISE_SDS, LEAST_GREY = 6.0, 10.0  # what differs by less than so many sds, or grey levels, is noise
SMOOTH_PX = 1.0
LEAST_AREA_PX2, MOST_SHARE, MOST_PARTS = 12, 0.2, 20
"""Parts smaller, or larger than this share of the picture, are none."""
FILLS = 0.3  # of the box around it: what fills less has thin pieces
MOST_FOREGROUND = 0.3  # if more of a picture differs the camera moves
SAME_AREA = 1.5  # from a frame to the next an object's silhouette grows or shrinks by less
OFF_SIZE, OFF_STEP = 0.6, 0.35
"""How far a part may be from where a path leads, by its size and its way."""
MOST_AT_FIRST = 4.0
"""By so many of its sizes a thing is at most gone in the frame after its first: a ball of 15 px by
60."""
MOST_MISSED = 4.0  # usual steps for which a path may be hidden
TURN_BACK = 1.3  # what comes off a wall is at most so many of its steps away from where it was
LEADS_FRAMES, DEGREE = 4, 2  # a parabola through so many frames leads on


@dataclass(frozen=True)
class Part:
    """One connected part of a silhouette."""

    centre_px: np.ndarray  # `[2]`
    area_px2: float  # pixels
    low_px: np.ndarray  # `[2]`, upper left corner of the box around it
    high_px: np.ndarray  # `[2]`, lower right one

    @property
    def size_px(self) -> float:
        """The side of a square as large."""
        return float(np.sqrt(self.area_px2))


def way_px(places: Float[np.ndarray, "frame 2"]) -> float:
    """The diagonal of the box that holds places, px."""
    return float(np.hypot(*np.ptp(places, axis=0)))


@dataclass
class Path:
    """A part followed from frame to frame; `clock` in usual steps."""

    frames: list[int] = field(default_factory=list)
    clock: list[float] = field(default_factory=list)
    parts: list[Part] = field(default_factory=list)

    @property
    def places_px(self) -> Float[np.ndarray, "frame 2"]:
        """Where it was."""
        return np.stack([part.centre_px for part in self.parts])

    @property
    def sizes_px(self) -> Float[np.ndarray, " frame"]:
        """How large it was."""
        return np.array([part.size_px for part in self.parts])

    @property
    def way_px(self) -> float:
        """How far it went: the diagonal of the box that holds its places."""
        return way_px(self.places_px)

    def append(self, frame: int, now: float, part: Part) -> None:
        """One frame further."""
        self.frames.append(frame)
        self.clock.append(now)
        self.parts.append(part)

    def misses(self, part: Part, now: float) -> float:
        """How far a part is from where it should be, by how far it may be; inf: another thing."""
        last = self.parts[-1]
        if not 1 / SAME_AREA < part.area_px2 / last.area_px2 < SAME_AREA:
            return np.inf
        back = length(part.centre_px - last.centre_px)
        if len(self.parts) == 1:  # nobody knows how fast it is
            return back / (MOST_AT_FIRST * last.size_px)
        clock, places = np.array(self.clock[-LEADS_FRAMES:]), self.places_px[-LEADS_FRAMES:]
        # By a parabola, at first by a line.
        expected = polynomial(clock - now, places, min(DEGREE, len(clock) - 1)).solution[-1]
        # The frame in which it is thrown back shows neither the speed before nor the one after.
        speeds = np.hypot(*np.diff(places, axis=0).T) / np.diff(clock)
        way = float(speeds.max()) * (now - clock[-1])
        near = length(part.centre_px - expected) / (OFF_SIZE * last.size_px + OFF_STEP * way)
        # What is thrown back is nearer to where it was than its way.
        return min(near, 0.5 + 0.5 * back / (TURN_BACK * way + OFF_SIZE * last.size_px))


def paths_of(
    open_frames: OpenFrames,
    clock: Float[np.ndarray, " frame"],
    some: Mapping[int, np.ndarray] | None = None,
) -> list[Path]:
    """The paths of all that moves before a scene that stands still; none if the camera moves.

    `some`: as of `some_frames`, where they were read already.
    """
    scene = _scene(list((some or some_frames(open_frames, len(clock))).values()))
    done: list[Path] = []
    going: list[Path] = []
    for index, frame in enumerate(open_frames()):
        parts, now = _parts(frame, scene), float(clock[index])
        done += [path for path in going if now - path.clock[-1] > MOST_MISSED]
        going = [path for path in going if now - path.clock[-1] <= MOST_MISSED]
        pairs = [
            (path.misses(part, now), i, j)
            for i, path in enumerate(going)
            for j, part in enumerate(parts)
        ]
        led, free = set(), set(range(len(going)))
        for off, i, j in sorted(pairs):
            if off < 1 and i in free and j not in led:
                free.remove(i)
                led.add(j)
                going[i].append(index, now, parts[j])
        going += [Path([index], [now], [part]) for j, part in enumerate(parts) if j not in led]
    return done + going


def _scene(kept: list[np.ndarray]) -> np.ndarray:
    """The median of some frames, `[height, width]` or with colours behind, int16."""
    rows = [np.median([one[row] for one in kept], axis=0) for row in range(len(kept[0]))]
    return np.array(rows, np.int16)


def differences(some: Mapping[int, np.ndarray]) -> dict[int, np.ndarray]:
    """By the number of each later frame, the parts in which it differs from the first one.

    `[height, width]`, a number for each connected part, 0 where there is no difference; frames in
    which the camera has moved are left out. `some`: as of `some_frames`.
    """
    every = {index: _differs(frame, some[0]) for index, frame in some.items() if index}
    return {
        index: cv2.connectedComponents(mask.astype(np.uint8))[1]
        for index, mask in every.items()
        if mask.mean() <= MOST_FOREGROUND
    }


def _differs(picture: np.ndarray, scene: np.ndarray) -> np.ndarray:
    """Where a picture differs from the scene in any colour, `[height, width]`."""
    differs = cv2.GaussianBlur(picture.astype(np.int16) - scene, (0, 0), SMOOTH_PX)
    some = np.atleast_3d(differs)[::4, ::4]
    middle = np.median(some, axis=(0, 1))
    noise = 1.4826 * np.median(np.abs(some - middle), axis=(0, 1))
    most = np.maximum(NOISE_SDS * noise, LEAST_GREY)
    return cv2.inRange(differs, middle - most, middle + most) == 0


def _parts(picture: np.ndarray, scene: np.ndarray) -> list[Part]:
    """What differs from the scene in any colour, largest first, without what the edge cuts."""
    mask = _differs(picture, scene)
    if mask.mean() > MOST_FOREGROUND:
        return []
    _, labels, stats, centres = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    height, width = mask.shape
    found = []
    for label, (centre, one) in enumerate(zip(centres[1:], stats[1:], strict=True), 1):
        left, top, wide, high, area = one.tolist()
        low, end = np.array([left, top]), np.array([left + wide, top + high])
        is_cut = (low == 0).any() or (end == (width, height)).any()
        if is_cut or not LEAST_AREA_PX2 <= area <= MOST_SHARE * mask.size:
            continue
        part = Part(centre, float(area), low, end - 1)
        if area < FILLS * wide * high:
            part = _thick(part, labels[top : top + high, left : left + wide] == label)
        found.append(part)
    return sorted(found, key=lambda part: -part.area_px2)[:MOST_PARTS]


def _thick(part: Part, mask: np.ndarray) -> Part:
    """The largest piece of a part that is half as thick as its thickest place or more.

    A ball without the thread that it hangs on, or a box without the edge of its shadow.
    """
    padded = np.pad(mask.astype(np.uint8), 1)
    radius = float(cv2.distanceTransform(padded, cv2.DIST_L2, 5).max())
    size = 2 * max(round(radius / 2), 1) + 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    opened = cv2.morphologyEx(padded, cv2.MORPH_OPEN, kernel)
    _, _, stats, centres = cv2.connectedComponentsWithStats(opened)
    if len(stats) < 2:
        return part
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    left, top, wide, high, area = stats[largest].tolist()
    corner = part.low_px - 1
    low = corner + np.array([left, top])
    return Part(centres[largest] + corner, float(area), low, low + np.array([wide, high]) - 1)

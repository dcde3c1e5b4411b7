"""The pieces of an object's path: a new one begins where it is put right and looks otherwise."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from galileo_jax.tracking.exposure import Exposure
from galileo_jax.tracking.follower import SAME_PLACE, Follower
from galileo_jax.tracking.picture import Picture, View
from galileo_jax.tracking.pose import length
from galileo_jax.tracking.refiner import Velocities, velocities_at
from galileo_jax.tracking.template import Outline, grey, template_at


@dataclass(frozen=True)
class Start:
    """Where an object is first seen."""

    name: str  # the object's
    point_px: tuple[float, float]  # `(x, y)` of the point to follow, in frame `first_frame`
    outline: Outline  # what the object fills around the point
    first_frame: int = 0  # frames before are not looked at
    last_frame: int | None = None  # nor are frames after; None: to the end
    # where somebody has seen it in later frames, in time's order: it is followed on from there
    corrections: "tuple[Start, ...]" = ()
    view: View = grey  # in which it is looked at

    def uses(self, index: int) -> bool:
        """Whether a frame is looked at."""
        return self.first_frame <= index <= (index if self.last_frame is None else self.last_frame)


@dataclass(frozen=True)
class Piece:
    """One look of an object."""

    first_frame: int  # in which it begins
    point_px: tuple[float, float]  # the followed point there
    follower: Follower  # with its poses from that frame on
    corrected: tuple[int, ...] = ()  # frames in which somebody has put it right
    turned_rad: float = 0.0  # how far the object had turned when the piece began
    view: View = grey

    @property
    def is_clicked(self) -> bool:
        """Whether its point is only as good as a click in the middle of the motion."""
        return self.first_frame in self.corrected

    def poses(self, count: int) -> np.ndarray:
        """The first pass's `[frame, 3]`; NaN outside of the piece and where not found."""
        found = np.full((count, 3), np.nan)
        for frame, pose in zip(range(self.first_frame, count), self.follower.poses, strict=False):
            found[frame] = pose
        return found

    def velocities(self, poses: np.ndarray, frame: int, clock: np.ndarray) -> Velocities:
        """Around a frame; it is not known how the object came to where somebody put it right."""
        first = max((at for at in self.corrected if at <= frame), default=0)
        end = min((at for at in self.corrected if at > frame), default=len(poses))
        return velocities_at(poses[first:end], frame - first, clock[first:end])


def follow_on(
    pieces: list[Piece],
    start: Start,
    index: int,
    before: Mapping[View, Picture] | None,
    now: Mapping[View, Picture],
    exposure: Exposure,
    beside: Sequence[Follower],
    step: float,
) -> None:
    """One frame further; `pieces`, the object's so far, grows where a new one begins.

    `now` and `before` are this frame and the last one, as they are looked at. `beside` are the
    other objects, which may hit it; `step` is the time since the last frame, in usual steps.
    """
    picture = now[start.view]
    if not pieces:
        pieces.append(_begun(start, picture, exposure))
    elif (told := next((c for c in start.corrections if c.first_frame == index), None)) is not None:
        last = pieces[-1]
        if last.follower.put_right(picture, told.point_px):
            pieces[-1] = replace(last, corrected=(*last.corrected, index))
            return
        turned = last.turned_rad + float(last.follower.pose[2])
        begun = _begun(replace(told, view=start.view), picture, exposure)
        pieces.append(replace(begun, corrected=(index,), turned_rad=turned))
    own = pieces[-1]
    own.follower.is_alone = not beside
    own.follower.fastest_px = max((one.speed_px for one in beside), default=0.0)
    last = before[own.view] if before is not None and index > own.first_frame else None
    own.follower.step(last, picture, step)


def keep_apart(
    pieces: Sequence[Piece],
    index: int,
    before: Mapping[View, Picture] | None,
    now: Mapping[View, Picture],
) -> None:
    """Of two objects at one place the one that is less expected there is sought elsewhere."""
    for one, other in combinations([piece for piece in pieces if index > piece.first_frame], 2):
        pair = [one.follower, other.follower]
        # NaN compares False: what is not found is nowhere.
        apart_px = length(pair[0].poses[-1] - pair[1].poses[-1])
        if apart_px < SAME_PLACE * min(follower.size_px for follower in pair):
            strays, stays = sorted((one, other), key=lambda each: -each.follower.off_course_px)
            last = None if before is None else before[strays.view]
            strays.follower.again(last, now[strays.view], (stays.follower.poses[-1],))


def _begun(start: Start, picture: Picture, exposure: Exposure) -> Piece:
    point = np.array(start.point_px, dtype=float)
    template = template_at(picture.grey, point, start.outline, by_edge=start.view is not grey)
    follower = Follower(template, np.array([*point, 0.0]), exposure, picture)
    return Piece(start.first_frame, start.point_px, follower, view=start.view)

"""Tracking a video: two passes, of which the second sees what the first kept around the objects."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from galileo_jax.tracking.exposure import Exposure
from galileo_jax.tracking.finish import finished
from galileo_jax.tracking.follower import Follower
from galileo_jax.tracking.picture import Picture
from galileo_jax.tracking.refiner import Refined, refine_pose, velocities_at
from galileo_jax.tracking.template import Outline, grey, median_template, template_at
from galileo_jax.tracking.track import Track

MAX_KEPT_BYTES = 256 << 20
"""Of a longer video the second pass decodes the frames again."""


@dataclass(frozen=True)
class Start:
    """Where an object is first seen.

    Attributes:
      name: the object's.
      point_px: `(x, y)` of the point to follow, in frame `first_frame`.
      outline: what the object fills around the point.
      first_frame: frames before are not looked at.
    """

    name: str
    point_px: tuple[float, float]
    outline: Outline
    first_frame: int = 0


def track_video(
    open_frames: Callable[[], Iterable[np.ndarray]],
    starts: Sequence[Start],
    fps: float,
    *,
    advance: Callable[[], None] = lambda: None,
) -> Track:
    """Follows the point of each start through a video.

    First pass: from frame to frame (Lucas-Kanade features, then alignment with the first
    frame's patch), which also shows the exposure time. Then one clean template per object, the
    median of its sharp patches. Second pass: every pose again, by alignment with that template,
    smeared by the motion; the first frame's pose fixes where on the object the point lies.

    Args:
      open_frames: gives the frames from the beginning, `[height, width, 3]` uint8, BGR (or
        grey); called again if the video is long.
      starts: at least one.
      fps: frames per second.
      advance: called after every frame of both passes (a progress bar).
    """
    exposure, kept = Exposure(), _Kept(len(starts))
    followers: list[Follower | None] = [None] * len(starts)
    before: Picture | None = None
    count, size_px = 0, (0, 0)
    for index, frame in enumerate(open_frames()):
        picture = Picture(grey(frame))
        for k, start in enumerate(starts):
            if index == start.first_frame:
                point = np.array(start.point_px, dtype=float)
                template = template_at(picture.grey, point, start.outline)
                followers[k] = Follower(template, np.array([*point, 0.0]), exposure, picture)
            follower = followers[k]
            if follower is not None:
                follower.step(before if index > start.first_frame else None, picture)
                kept.add(k, index, picture, follower)
        before = picture
        count, size_px = index + 1, picture.size_px
        advance()

    coarse = [_coarse_poses(follower, count) for follower in followers]
    templates = [
        median_template(f.patches, f.template.region) if f is not None else None for f in followers
    ]
    fits: list[list[Refined | None]] = [[] for _ in starts]
    for index, pictures in enumerate(kept.pictures(open_frames, count)):
        for poses, template, found, picture in zip(coarse, templates, fits, pictures, strict=True):
            if template is None or picture is None or not np.isfinite(poses[index, 0]):
                found.append(None)
                continue
            velocities = velocities_at(poses, index)
            found.append(refine_pose(picture, template, poses[index], velocities, exposure.share))
        advance()

    objects = finished(
        fits,
        [start.point_px for start in starts],
        [start.first_frame for start in starts],
        exposure.share,
    )
    return Track(
        names=tuple(start.name for start in starts),
        times_s=np.arange(count) / fps,
        position_px=np.stack([item.position_px for item in objects]),
        covariance_px2=np.stack([item.covariance_px2 for item in objects]),
        angle_rad=np.stack([item.angle_rad for item in objects]),
        is_visible=np.stack([np.isfinite(item.angle_rad) for item in objects]),
        frame_size_px=size_px,
    )


class _Kept:
    """What the first pass saw of the objects, so that the second need not decode the video."""

    def __init__(self, num_objects: int):
        self._parts: list[dict[int, Picture]] | None = [{} for _ in range(num_objects)]
        self._num_objects, self._bytes = num_objects, 0

    def add(self, k: int, index: int, picture: Picture, follower: Follower) -> None:
        """Keeps the part of a frame in which object `k` was found."""
        pose = follower.poses[-1]
        if self._parts is None or not np.isfinite(pose[0]):
            return
        part = picture.part(pose, follower.template.radius)
        self._parts[k][index] = part
        self._bytes += part.grey.nbytes
        if self._bytes > MAX_KEPT_BYTES:
            self._parts = None

    def pictures(
        self, open_frames: Callable[[], Iterable[np.ndarray]], count: int
    ) -> Iterator[list[Picture | None]]:
        """For every frame what is there of every object; decodes again where it was too much."""
        if self._parts is not None:
            for index in range(count):
                yield [parts.get(index) for parts in self._parts]
            return
        for frame in itertools.islice(open_frames(), count):
            yield [Picture(grey(frame))] * self._num_objects


def _coarse_poses(follower: Follower | None, count: int) -> np.ndarray:
    """The first pass's poses `[frame, 3]`, NaN before the first frame and where not found."""
    poses = np.full((count, 3), np.nan)
    if follower is not None:
        poses[count - len(follower.poses) :] = follower.poses
    return poses

"""Tracking a video: two passes over the stream, nothing kept but poses and small patches."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from galileo_jax.tracking.exposure import Exposure
from galileo_jax.tracking.follower import Follower
from galileo_jax.tracking.noise import LEAST_SD_PX, blow_covariance, scatter_variance
from galileo_jax.tracking.pose import rotation
from galileo_jax.tracking.refiner import Refined, refine_pose, velocities_at
from galileo_jax.tracking.template import Outline, grey, median_template, template_at
from galileo_jax.tracking.track import Track

MIN_CORRELATION = 0.7
MAX_COVERED, MAX_OUTSIDE = 0.25, 0.1
"""An object is visible if its patch correlates with the template, no more of it than these
shares differs from the template by more than noise, or lies beyond the picture's border."""

LONG_RUN = 10
"""A run of so many frames is believed after any gap."""


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
        grey); called twice.
      starts: at least one.
      fps: frames per second.
      advance: called after every frame of both passes (a progress bar).
    """
    followers: list[Follower | None] = [None] * len(starts)
    exposure = Exposure()
    before: np.ndarray | None = None
    count, size_px = 0, (0, 0)
    for index, frame in enumerate(open_frames()):
        image = grey(frame)
        for k, start in enumerate(starts):
            if index == start.first_frame:
                point = np.array(start.point_px, dtype=float)
                template = template_at(image, point, start.outline)
                followers[k] = Follower(template, np.array([*point, 0.0]), exposure, image)
            follower = followers[k]
            if follower is not None:
                follower.step(before if index > start.first_frame else None, image)
        before = image
        count, size_px = index + 1, (image.shape[1], image.shape[0])
        advance()

    coarse = [_coarse_poses(follower, count) for follower in followers]
    templates = [
        median_template(f.patches, f.template.region) if f is not None else None for f in followers
    ]
    fits: list[list[Refined | None]] = [[] for _ in starts]
    for index, frame in enumerate(open_frames()):
        image = grey(frame)
        for poses, template, found in zip(coarse, templates, fits, strict=True):
            if template is None or not np.isfinite(poses[index, 0]):
                found.append(None)
                continue
            velocities = velocities_at(poses, index)
            found.append(refine_pose(image, template, poses[index], velocities, exposure.share))
        advance()

    objects = [
        _finished(found, start, exposure.share) for found, start in zip(fits, starts, strict=True)
    ]
    return Track(
        names=tuple(start.name for start in starts),
        times_s=np.arange(count) / fps,
        position_px=np.stack([position for position, _, _ in objects]),
        covariance_px2=np.stack([covariance for _, covariance, _ in objects]),
        angle_rad=np.stack([angle for _, _, angle in objects]),
        is_visible=np.stack([np.isfinite(angle) for _, _, angle in objects]),
        frame_size_px=size_px,
    )


def _coarse_poses(follower: Follower | None, count: int) -> np.ndarray:
    """The first pass's poses `[frame, 3]`, NaN before the first frame and where not found."""
    poses = np.full((count, 3), np.nan)
    if follower is not None:
        poses[count - len(follower.poses) :] = follower.poses
    return poses


def _finished(
    fits: list[Refined | None], start: Start, exposure_share: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position `[frame, 2]`, covariance `[frame, 2, 2]` and angle `[frame]`; NaN: not visible."""
    poses = np.full((len(fits), 3), np.nan)
    covariance = np.full((len(fits), 2, 2), np.nan)
    for index, fit in enumerate(fits):
        if fit is not None and _is_visible(fit):
            poses[index] = fit.pose
            covariance[index] = fit.covariance
    is_doubtful = ~_without_glimpses(np.isfinite(poses[:, 0]))
    poses[is_doubtful], covariance[is_doubtful] = np.nan, np.nan
    seen = np.flatnonzero(~is_doubtful)
    if not len(seen):
        return poses[:, :2], covariance, poses[:, 2]
    jumps = np.zeros_like(poses)
    jumps[seen] = [velocities_at(poses, int(index)).jump for index in seen]
    covariance += blow_covariance(jumps, exposure_share)
    scatter = scatter_variance(poses, covariance) + LEAST_SD_PX**2
    covariance += scatter[:, None, None] * np.eye(2)

    first = fits[start.first_frame]
    anchor = first.pose if first is not None else np.array([*start.point_px, 0.0])
    angle = poses[:, 2] - anchor[2]
    arm = np.array(start.point_px) - anchor[:2]
    position = poses[:, :2] + np.stack([rotation(a) @ arm for a in angle])
    return position, covariance, angle


def _without_glimpses(is_seen: np.ndarray) -> np.ndarray:
    """`is_seen` `[frame]` without the runs that are shorter than the gap before them.

    What comes back for a few frames after a long absence is more likely something like it.
    """
    result = np.zeros_like(is_seen)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_seen, [False]]).astype(int)))
    last_end: int | None = None
    for begin, end in edges.reshape(-1, 2):
        if last_end is None or end - begin >= min(begin - last_end, LONG_RUN):
            result[begin:end] = True
            last_end = end
    return result


def _is_visible(fit: Refined) -> bool:
    is_shown = fit.covered <= MAX_COVERED and fit.outside <= MAX_OUTSIDE
    return is_shown and fit.correlation >= MIN_CORRELATION

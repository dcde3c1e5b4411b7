"""From pixels to metres: the last place that knows pixels."""

from collections.abc import Sequence

import numpy as np

from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.track import Track

NOISE_KNOWN_TO = 0.15
"""Beyond chance, the logarithm of the mean square of errors over stated errors differed from one
stretch of a path to the next by 0.18, 0.19, 0.10 and 0.10 (object 1 along x on the ramp and on the
table, along y on the ramp, object 2 along x; 120 rendered clips that were looked at)."""


def observe(clip: Clip, track: Track) -> Observation:
    """Turns a track in pixels into an observation in metres.

    By the clip's `picture_plane`. Without `origin_px` the first seen point of the first object is
    the origin. Without `pixels_per_metre` lengths are in units of `NOMINAL_SCALE` pixels, and the
    model must carry the scale as an unknown.

    Raises:
      InputError: an object is not seen, or seen beyond the horizon of the declared rectangle.
    """
    mask = _mask(clip, track)
    plane = picture_plane(clip, origin_of(clip, track))
    position = plane.to_metres(track.position_px)
    if not np.isfinite(position[mask]).all():
        raise InputError(
            f"{clip.path}: rectangle: an object is seen where the plane of these "
            "corners_px is not; correct them"
        )
    slope = plane.slope(track.position_px)
    is_level = SCENARIOS[clip.scenario].is_level
    # What the first frame is off by is one error of all frames, which the likelihood has as what it
    # is: an offset of the track. As every frame's own error it would hide the motion.
    own_px2 = track.covariance_px2 - track.common_px2
    covariance = slope @ own_px2 @ np.swapaxes(slope, -1, -2)
    return Observation(
        names=track.names,
        times_s=track.times_s,
        position_m=np.moveaxis(position, 1, 2),
        covariance_m2=np.moveaxis(covariance, 1, -1),
        mask=mask,
        noise_known_to=NOISE_KNOWN_TO,
        turned_rad=_turned(track, slope, mask) if is_level else None,
    )


def _turned(track: Track, slope: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """How far objects have turned, `[object, frame]`, rad; NaN of one that looks alike all round.

    Args:
      track: its angles are clockwise in the picture.
      slope: `[object, frame, 2, 2]`, metres per pixel; its sign tells whether that is mirrored.
      mask: `[object, frame]`.
    """
    turned = np.where(mask, np.sign(np.linalg.det(slope)) * track.angle_rad, np.nan)
    shows = np.array(
        [
            np.ptp(own[seen]) > 0 if seen.any() else False
            for own, seen in zip(turned, mask, strict=True)
        ]
    )
    return np.where(shows[:, None], turned, np.nan)


def origin_of(clip: Clip, track: Track) -> Sequence[float]:
    """Where x and y are 0: declared, or the first seen point of the first object, px."""
    if clip.origin_px is not None:
        return clip.origin_px
    seen = np.flatnonzero(_mask(clip, track)[0])
    if not seen.size:
        raise InputError(f"{clip.path}: {track.names[0]} is not seen in any frame")
    return track.position_px[0, seen[0]]


def _mask(clip: Clip, track: Track) -> np.ndarray:
    mask = track.is_visible.copy()
    for i, declared in enumerate(clip.objects):
        mask[i, : declared.first_frame or 0] = False
    return mask

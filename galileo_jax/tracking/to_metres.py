"""From pixels to metres: the last place that knows pixels."""

import numpy as np

from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import NOMINAL_SCALE_PX_PER_M, Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.track import Track


def observe(clip: Clip, track: Track) -> Observation:
    """Turns a track in pixels into an observation in metres.

        x = +-(px - origin) / scale (plus for `direction: right`),   y = (origin - py) / scale

    Without `origin_px` the first seen point of the first object is the origin. Without
    `pixels_per_metre` lengths are in units of `NOMINAL_SCALE` pixels, and the model must
    carry the scale as an unknown.
    """
    scale = clip.pixels_per_metre or NOMINAL_SCALE_PX_PER_M
    sign = 1.0 if clip.direction == "right" else -1.0
    mask = track.is_visible.copy()
    for i, declared in enumerate(clip.objects):
        mask[i, : declared.first_frame or 0] = False
    if clip.origin_px is not None:
        origin = np.asarray(clip.origin_px)
    else:
        seen = np.flatnonzero(mask[0])
        if not seen.size:
            raise InputError(f"{clip.path}: {track.names[0]} is not seen in any frame")
        origin = track.position_px[0, seen[0]]
    axes = np.array([sign, -1.0])
    position = (track.position_px - origin) * axes / scale
    covariance = track.covariance_px2 * np.outer(axes, axes) / scale**2
    return Observation(
        names=track.names,
        times_s=track.times_s,
        position_m=np.moveaxis(position, 1, 2),
        covariance_m2=np.moveaxis(covariance, 1, -1),
        mask=mask,
    )

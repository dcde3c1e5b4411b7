"""How the declared geometry of a camera may be off, as patterns in the track.

    mode_c = (metres(corners + sd e_c) - metres(corners - sd e_c)) / 2,    sd = half a pixel

for each of the rectangle's eight coordinates, and likewise for the lens's k1: the derivative of the
map by what was clicked, times how well one clicks. Scale, origin and the direction of the path
all move together, as one wrong corner moves them.

Source: Hartley and Zisserman, Multiple View Geometry (2004), section 5.2 (propagation of errors).
"""

from dataclasses import replace

import numpy as np

from galileo_jax.clip.picture_plane import nearby_planes
from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.tracking.to_metres import origin_of
from galileo_jax.tracking.track import Track


def with_camera_modes(clip: Clip, observation: Observation, track: Track) -> Observation:
    """The observation with what its declared camera leaves uncertain.

    Args:
      clip: of a video.
      observation: what `tracking.to_metres.observe` makes of the track.
      track: in pixels.
    """
    planes = nearby_planes(clip, origin_of(clip, track))
    if not planes:
        return observation
    found = np.stack(
        [
            more.to_metres(track.position_px) - less.to_metres(track.position_px)
            for more, less in planes
        ]
    )
    modes = np.where(observation.mask[:, None], np.swapaxes(found, -1, -2) / 2, 0.0)
    if observation.modes_m is not None:
        modes = np.concatenate([modes, observation.modes_m])
    return replace(observation, modes_m=modes, is_squared=clip.rectangle is not None)

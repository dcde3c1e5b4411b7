"""What a coder may shift a moving object by, beside what the tracker took off, as patterns.

An object that slows down evenly crosses half pixels slowly, so that a shift that was taken off a
little too much or too little lasts for several frames: of all errors of a tracked video those that
look most like a small force. How much is left wanders in the course of a motion,

    error_t = s_t pattern_t,    s ~ N(0, exp(-|frames apart| / LASTS_FRAMES)).
"""

from dataclasses import replace

import numpy as np

from galileo_jax.clip.picture_plane import picture_plane
from galileo_jax.clip.schema import Clip
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.random_patterns import random_patterns
from galileo_jax.tracking.motion_compensation import LASTS_FRAMES
from galileo_jax.tracking.to_metres import origin_of
from galileo_jax.tracking.track import Track

FAINT = 0.01  # of the strongest: what is weaker among an object's patterns is left out
# Of the stated noise, everywhere: patterns that are weaker change no estimate.
NEGLIGIBLE = 0.03


def with_coding_errors(clip: Clip, observation: Observation, track: Track) -> Observation:
    """The observation with these errors among `modes_m`, the last.

    Args:
      clip: of a video.
      observation: what `tracking.to_metres.observe` makes of the track.
      track: in pixels.
    """
    slope = picture_plane(clip, origin_of(clip, track)).slope(track.position_px)
    shifts = np.einsum("ofij,ofpj->opif", slope, track.shifts_px)
    shifts = np.where(observation.mask[:, None, None], shifts, 0.0)
    sd = np.sqrt(np.einsum("oiif->oif", observation.covariance_m2))
    frames = np.arange(len(track.times_s))
    wander = np.exp(-np.abs(frames[:, None] - frames) / LASTS_FRAMES)
    found = []
    for i, own in enumerate(shifts):
        for shift in own:
            relative = np.where(observation.mask[i], np.abs(shift) / sd[i], 0.0)
            if relative.max() < NEGLIGIBLE:
                continue
            size = np.linalg.norm(shift, axis=0)
            for pattern in random_patterns(size[:, None] * wander * size, FAINT):
                mode = np.zeros_like(observation.position_m)
                mode[i] = shift / np.where(size > 0, size, 1.0) * pattern
                found.append(mode)
    if not found:
        return observation
    before = [] if observation.modes_m is None else list(observation.modes_m)
    number = observation.num_errors + len(found)
    return replace(observation, modes_m=np.stack([*before, *found]), num_errors=number)

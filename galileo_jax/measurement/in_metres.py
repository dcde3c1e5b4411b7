"""From a film or a table to an observation: places in metres, and what is known of errors.

    film    track in pixels (once) -> times of lost pictures -> plane -> errors at rest, of coder,
            of camera -> turning
    table   read in metres -> errors that many frames share

Two kinds of errors are patterns in the track (`Observation.modes_m`): how the declared geometry of
the camera may be off,

    mode_c = (metres(corners + sd e_c) - metres(corners - sd e_c)) / 2,    sd = half a pixel

for each of the rectangle's eight coordinates, and likewise for the lens's k1 (scale, origin and the
direction of the path all move together, as one wrong corner moves them); and what a coder may shift
a moving object by, beside what the tracker took off. An object that slows down evenly crosses half
pixels slowly, so that a shift that was taken off a little too much or too little lasts for several
frames: of all errors of a tracked video those that look most like a small force. How much is left
wanders in the course of a motion,

    error_t = s_t pattern_t,    s ~ N(0, exp(-|frames apart| / LASTS_FRAMES)).

Source: Hartley and Zisserman, Multiple View Geometry (2004), section 5.2 (propagation of errors).
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.clip.lost_frames import with_lost_frames
from galileo_jax.clip.picture_plane import nearby_planes, picture_plane
from galileo_jax.clip.scenarios import SCENARIOS
from galileo_jax.clip.schema import Clip
from galileo_jax.clip.track_file import read_track
from galileo_jax.clip.track_noise import position_noise_m
from galileo_jax.measurement.errors_at_rest import with_errors_at_rest
from galileo_jax.measurement.shared_errors import beside, with_errors
from galileo_jax.measurement.track_cache import track_once
from galileo_jax.numerics.random_patterns import alone, random_patterns
from galileo_jax.observation.observation import Observation
from galileo_jax.runtime.errors import InputError
from galileo_jax.tracking.motion_compensation import LASTS_FRAMES
from galileo_jax.tracking.track import Track

NOISE_KNOWN_TO = 0.15
"""Sd, beyond chance, of the log mean square of errors over stated ones from one stretch of a path
to the next: 0.18, 0.19, 0.10 and 0.10 (120 rendered clips)."""
FAINT = 0.01  # of the strongest: what is weaker among an object's patterns is left out
NEGLIGIBLE = 0.03  # of the stated noise, everywhere: patterns that are weaker change no estimate
LEAST_RAD = 2e-3  # as well as a picture of a puck shows how it stands
UNSEEN_RAD = 1e3  # the error of what nothing shows: it counts for nothing


def observed(clip: Clip) -> tuple[Observation, Track | None]:
    """The clip's track in metres, and in pixels where it is tracked here, or an `InputError`."""
    if clip.video is None:
        assert clip.track is not None  # load_clip requires one of the two
        read = read_track(clip.path, clip.track, clip, clip.fps)
        observation = read.observation
        if read.is_own:
            observation = with_errors(beside(clip.track), observation)
        for i, item in enumerate(clip.objects):
            observation = observation.without(slice(item.first_frame or 0), i)
            if item.last_frame is not None:
                observation = observation.without(slice(item.last_frame + 1, None), i)
        return observation, None
    track = track_once(clip)
    seen = np.where(track.is_visible[..., None], track.position_px, np.nan)
    track = replace(track, times_s=with_lost_frames(track.times_s, np.moveaxis(seen, 1, 2)))
    observation = with_errors_at_rest(observe(clip, track))
    observation = with_coding_errors(clip, observation, track)
    observation = with_camera_modes(clip, observation, track)
    return with_turning(observation) if clip.turning else observation, track


def observe(clip: Clip, track: Track) -> Observation:
    """A track in pixels as an observation in metres, by the clip's `picture_plane`.

    Without `origin_px` the first seen point of the first object is the origin. Without
    `pixels_per_metre` lengths are in units of `NOMINAL_SCALE` pixels, and the model must carry the
    scale as an unknown.

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
    # What the first frame is off by is one error of all frames, which the likelihood has as what it
    # is: an offset of the track. As every frame's own error it would hide the motion.
    covariance = slope @ (track.covariance_px2 - track.common_px2) @ np.swapaxes(slope, -1, -2)
    turned = None
    if SCENARIOS[clip.scenario].is_level:
        # Clockwise in the picture, unless that is mirrored.
        turned = np.where(mask, np.sign(np.linalg.det(slope)) * track.angle_rad, np.nan)
        looks_alike = [len(set(own[seen])) < 2 for own, seen in zip(turned, mask, strict=True)]
        turned[looks_alike] = np.nan
    return Observation(
        names=track.names,
        times_s=track.times_s,
        position_m=np.moveaxis(position, 1, 2),
        covariance_m2=np.moveaxis(covariance, 1, -1),
        mask=mask,
        noise_known_to=NOISE_KNOWN_TO,
        turned_rad=turned,
    )


def origin_of(clip: Clip, track: Track) -> Sequence[float]:
    """Where x and y are 0: declared, or the first seen point of the first object, px."""
    if clip.origin_px is not None:
        return clip.origin_px
    seen = np.flatnonzero(_mask(clip, track)[0])
    if not seen.size:
        raise InputError(f"{clip.path}: {track.names[0]} is not seen in any frame")
    return track.position_px[0, seen[0]]


def _mask(clip: Clip, track: Track) -> Bool[np.ndarray, "object frame"]:
    mask = track.is_visible.copy()
    for i, declared in enumerate(clip.objects):
        mask[i, : declared.first_frame or 0] = False
    return mask


def with_coding_errors(clip: Clip, observation: Observation, track: Track) -> Observation:
    """The observation with what a coder may shift it by among its modes, as errors."""
    slope = picture_plane(clip, origin_of(clip, track)).slope(track.position_px)
    shifts = np.einsum("ofij,ofpj->opif", slope, track.shifts_px)
    shifts = np.where(observation.mask[:, None, None], shifts, 0.0)
    sd = np.sqrt(np.einsum("oiif->oif", observation.covariance_m2))
    found = [
        mode for i in range(len(shifts)) for mode in _shift_of_some(i, observation, track, slope)
    ]
    for i, own in enumerate(shifts):
        seen = np.flatnonzero(observation.mask[i])
        wander = np.exp(-np.abs(seen[:, None] - seen) / LASTS_FRAMES)
        for shift in own[..., seen]:
            if (np.abs(shift) / sd[i][:, seen]).max(initial=0.0) < NEGLIGIBLE:
                continue
            size = np.linalg.norm(shift, axis=0)
            for pattern in random_patterns(size[:, None] * wander * size, FAINT):
                mode = shift / np.where(size > 0, size, 1.0) * pattern
                found.append(alone(observation.position_m, i, slice(None), mode, seen))
    return observation.with_modes(errors=found) if found else observation


def _shift_of_some(
    index: int, observation: Observation, track: Track, slope: Float[np.ndarray, "object frame 2 2"]
) -> list[Float[np.ndarray, "object axis frame"]]:
    """The error that some of an object's points have in common, against the others: x and y of it.

    `slope`: of the picture plane, metres to the pixel.
    """
    seen = observation.mask[index]
    size_px2 = np.where(seen, np.einsum("fii->f", track.common_px2[index]) / 2, 0.0)
    if not (size_px2 > 0).any() or (size_px2[seen] > 0).all():
        return []
    shifts = np.where(seen, np.sqrt(size_px2) * slope[index].T, 0.0)
    return [alone(observation.position_m, index, slice(None), own) for own in shifts]


def with_camera_modes(clip: Clip, observation: Observation, track: Track) -> Observation:
    """The observation with what its declared camera leaves uncertain."""
    modes = [
        (more.to_metres(track.position_px) - less.to_metres(track.position_px)) / 2
        for more, less in nearby_planes(clip, origin_of(clip, track))
    ]
    if not modes:
        return observation
    mask = observation.mask[:, None]
    seen = [np.where(mask, np.swapaxes(mode, -1, -2), 0.0) for mode in modes]
    return replace(observation.with_modes(seen), is_squared=clip.rectangle is not None)


def with_turning(observation: Observation) -> Observation:
    """The observation with the pucks' turning, rad, as its third axis.

    Its error is estimated from its roughness. Of a puck that looks alike all round, and in frames
    in which its turning is not known, the error is so large that nothing is told.
    """
    if observation.turned_rad is None:
        return observation
    position, covariance = observation.position_m, observation.covariance_m2
    turned: Float[np.ndarray, "object frame"] = np.where(observation.mask, 0.0, np.nan)
    variance = np.full_like(turned, UNSEEN_RAD**2)
    for i, own in enumerate(observation.turned_rad):
        known = observation.mask[i] & np.isfinite(own)
        if known.any():
            turned[i, known] = np.unwrap(own[known])
            noise = position_noise_m(observation.times_s, np.where(known, turned[i], np.nan))
            variance[i, known] = max(LEAST_RAD, noise if np.isfinite(noise) else 0.0) ** 2
    whole = np.zeros((len(turned), 3, 3, turned.shape[1]))
    whole[:, :2, :2], whole[:, 2, 2] = covariance, variance
    modes = observation.modes_m
    return replace(
        observation,
        position_m=np.concatenate([position, turned[:, None]], axis=1),
        covariance_m2=whole,
        modes_m=None if modes is None else np.pad(modes, [(0, 0), (0, 0), (0, 1), (0, 0)]),
        is_turning=True,
        turned_rad=None,
    )

"""Bodies wobble across their path: in full where that costs nothing, else as their track shows.

They rock, sink into contacts and are lifted at a hit, by some tenths of a millimetre; how fast they
go along the path shows none of that. It is a rough wobble (an Ornstein-Uhlenbeck process). Where
errors are far smaller, nothing is left of what is measured across the path, and nothing is lost.
Where they are as large as the wobble it matters whether there is any: what is allowed for and is
not there counts as evidence that the noise is smaller than it is, by up to a twelfth, and with the
noise go all intervals. Then

- within a tenth of a second after the foot and after a hit a body may be as high as it will: it is
  lifted there, by up to a millimetre, and comes down again;
- each piece of a track between these, or at rest, lies as high and as askew as it will;
- within the pieces in which a body moves, the wobble has the size that explains best what is
  measured across the path, which is straight whatever the physics:

      across = parabola (a camera that is not square) + wobble + error,    w^2 K + s^2 sd^2

  by the likelihood of what the parabola leaves, s averaged over. The mean over all sizes is taken.
  Too small a one is made up for by a larger noise, and intervals are then too wide.

Source: Patterson, Thompson (1971), Biometrika 58, 545 (the likelihood of what a regression leaves).
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.observation.observation import Observation
from galileo_jax.observation.random_patterns import random_patterns

WOBBLE_SD_M, WOBBLE_S = 4e-4, 0.3
"""A large one, and how long it lasts; where a track is too short to tell, it is taken so."""
SIZES = np.concatenate([[0.0], np.geomspace(1 / 16, 1.5, 10)])
"""Tried, of a large one."""
SCALES, SCALE_SD = np.geomspace(0.5, 2.0, 9), 0.3
"""Of the stated errors, and the standard deviation of their logarithm."""
FALSIFIES = 0.03  # of the noise's variance: half of it of an interval
LEAST_FRAMES = 8  # of a piece
MOVED_M = 2e-3  # from where it begins and ends: nearer, a body may be at rest
BEFORE, AFTER_S = 1, 0.1  # frames before a blow, and how long after it a body is lifted
LEAST_SD_M = 1e-9  # of an error: one of none has no likelihood


def wobble(
    position: Float[np.ndarray, "object 2 frame"],
    observation: Observation,
    scene: Surroundings,
    past_foot: Float[np.ndarray, "object frame"],
) -> list[np.ndarray]:
    """The patterns of all objects times their standard deviations, each `[object, 2, frame]`, m.

    Args:
      position: measured, 0 where it was not.
      observation: the same, with errors.
      scene: with a surface.
      past_foot: share of each object's length that is past the foot; 0 on a slope without one.
    """
    apart = np.abs(observation.times_s[:, None] - observation.times_s)
    rough = random_patterns(np.exp(-apart / WOBBLE_S))
    across = _across(position, scene)
    own = [rough * WOBBLE_SD_M] * len(across)
    if falsifies_noise(rough, across, observation):
        size_m = wobble_size_m(position, observation, across, past_foot)
        own = [
            np.concatenate([rough * size_m, _lifts(position, observation, past_foot[i], i)])
            for i in range(len(across))
        ]
    found = []
    for i, patterns in enumerate(own):
        for pattern in patterns:
            one = np.zeros_like(position)
            one[i] = pattern * across[i]
            found.append(one)
    return found


def falsifies_noise(
    rough: Float[np.ndarray, "pattern frame"],
    across: Float[np.ndarray, "object 2 frame"],
    observation: Observation,
) -> bool:
    """Whether a large wobble that is not there would make the noise much smaller than it is.

    Its patterns, of variance g^2 in units of the noise, leave a share f = 1 / (1 + g^2) of what is
    seen to the noise. Where they are absent the noise's variance comes out too small by about
    sum f (1 - f) over the sum of all that tells of it, see `noise_scale`.
    """
    variance = np.einsum("oat,oabt,obt->ot", across, observation.covariance_m2, across)
    noise2 = float(np.median(variance[observation.mask]))
    gain2 = WOBBLE_SD_M**2 * np.sum(rough**2, axis=1) / max(noise2, LEAST_SD_M**2)
    left = 1 / (1 + gain2)
    told = 2 * rough.shape[1] - len(rough) + np.sum(left**2)
    return bool(np.sum(left * (1 - left)) > FALSIFIES * told)


def wobble_size_m(
    position: Float[np.ndarray, "object 2 frame"],
    observation: Observation,
    across: Float[np.ndarray, "object 2 frame"],
    past_foot: Float[np.ndarray, "object frame"],
) -> float:
    """Its standard deviation, m, in all objects of a clip.

    Args:
      position: as of `wobble`, like `observation` and `past_foot`.
      observation: the same, with errors.
      across: unit vectors across the path.
      past_foot: share of each object's length that is past the foot.
    """
    evidence = np.zeros(len(SIZES))
    for i, own in enumerate(across):
        place = np.sum(position[i] * own, axis=0)
        variance = np.einsum("at,abt,bt->t", own, observation.covariance_m2[i], own)
        for piece in _pieces(position, observation, past_foot[i], i):
            if not _moves(position, observation.mask[i], i)[piece[0]]:
                continue
            evidence += _evidence(observation.times_s[piece], place[piece], variance[piece])
    if not evidence.any():
        return WOBBLE_SD_M
    weight = np.exp(evidence - np.asarray(logsumexp(evidence)))
    return float(WOBBLE_SD_M * (weight @ SIZES))


def _across(
    position: Float[np.ndarray, "object 2 frame"], scene: Surroundings
) -> Float[np.ndarray, "object 2 frame"]:
    found = []
    for i, corner in enumerate(scene.corner_m):
        is_on_ramp = scene.comes_down[i] & (position[i, 0] < corner) | (not scene.has_table)
        slope = np.where(is_on_ramp, scene.angle_rad, 0.0)
        found.append([np.sin(slope), np.cos(slope)])
    return np.array(found)


def _lifts(
    position: Float[np.ndarray, "object 2 frame"],
    observation: Observation,
    past_foot: Float[np.ndarray, " frame"],
    i: int,
) -> Float[np.ndarray, "pattern frame"]:
    """How high and how askew each piece may lie; frames in none by themselves."""
    pieces = _pieces(position, observation, past_foot, i)
    in_none = np.ones(position.shape[-1], bool)
    found = []
    for piece in pieces:
        in_none[piece] = False
        for shape in (np.ones(len(piece)), np.linspace(-1.0, 1.0, len(piece))):
            own = np.zeros(len(in_none))
            own[piece] = shape
            found.append(own)
    return WOBBLE_SD_M * np.array([*found, *np.eye(len(in_none))[in_none]])


def _moves(
    position: Float[np.ndarray, "object 2 frame"], seen: Bool[np.ndarray, " frame"], i: int
) -> Bool[np.ndarray, " frame"]:
    """Frames in which object i is neither where it was first seen nor where it was last."""
    ends = np.flatnonzero(seen)[[0, -1]] if seen.any() else []
    away = [np.linalg.norm(position[i] - position[i][:, [end]], axis=0) > MOVED_M for end in ends]
    return np.all([seen, *away], axis=0)


def _blows(
    position: Float[np.ndarray, "object 2 frame"],
    mask: Bool[np.ndarray, "object frame"],
    past_foot: Float[np.ndarray, " frame"],
    i: int,
) -> list[int]:
    """Frames from which on object i is lifted: past the foot, hit, and nearest to another."""
    found = []
    beyond = np.flatnonzero(mask[i] & (past_foot == 1))
    if beyond.size and (past_foot < 1).any():
        found.append(int(beyond[0]))
    for j in range(len(position)):
        both = mask[i] & mask[j]
        if j == i or not both.any():
            continue
        apart = np.where(both, np.linalg.norm(position[j] - position[i], axis=0), np.inf)
        found.append(int(np.argmin(apart)))
        ahead = max(i, j)
        moved = np.flatnonzero(_moves(position, mask[ahead], ahead))
        found.extend(moved[:1].tolist())
    return found


def _pieces(
    position: Float[np.ndarray, "object 2 frame"],
    observation: Observation,
    past_foot: Float[np.ndarray, " frame"],
    i: int,
) -> list[np.ndarray]:
    """Frames in which object i rests, or moves on one plane and no blow has lifted it."""
    mask, times_s = observation.mask, observation.times_s
    blows = _blows(position, mask, past_foot, i)
    frames = np.arange(len(times_s))
    is_lifted = np.zeros(len(times_s), bool)
    for blow in blows:
        is_lifted |= (frames >= blow - BEFORE) & (times_s <= times_s[blow] + AFTER_S)
    is_in = mask[i] & ~is_lifted & ((past_foot == 0) | (past_foot == 1))
    # A number for each kind of frame: a change of it begins another piece.
    kind = 2 * past_foot + _moves(position, mask[i], i)
    starts = np.flatnonzero((np.diff(kind) != 0) | np.diff(is_in)) + 1
    return [
        piece
        for piece in np.split(frames, starts)
        if is_in[piece[0]] and len(piece) >= LEAST_FRAMES
    ]


def _evidence(
    times_s: Float[np.ndarray, " frame"],
    place_m: Float[np.ndarray, " frame"],
    variance_m2: Float[np.ndarray, " frame"],
) -> Float[np.ndarray, " size"]:
    """The log likelihood of each size, of what no parabola takes up of a piece."""
    sd = np.maximum(np.sqrt(variance_m2), LEAST_SD_M)
    since = (times_s - times_s[0]) / (times_s[-1] - times_s[0])
    basis, _ = np.linalg.qr(np.vander(since, 3) / sd[:, None], mode="complete")
    left = basis[:, 3:]
    rough = np.exp(-np.abs(times_s[:, None] - times_s) / WOBBLE_S) / np.outer(sd, sd)
    values, vectors = np.linalg.eigh(left.T @ rough @ left)
    amplitude = vectors.T @ (left.T @ (place_m / sd))
    wobbles = (WOBBLE_SD_M * SIZES) ** 2 * values[:, None]
    variance = SCALES[:, None, None] ** 2 + wobbles.T
    square = amplitude**2 / variance
    log_density = -0.5 * np.sum(square + np.log(variance), axis=-1)  # [scale, size]
    prior = -0.5 * (np.log(SCALES) / SCALE_SD) ** 2
    return np.asarray(logsumexp(log_density + prior[:, None], axis=0))

"""What is known to be imperfect in every measurement of this kind, as covariance.

A camera is never quite square to the scene, a marked point never quite the centre, and a box
crosses the foot of the ramp on its edges, which a point does not. Each such imperfection is a
known pattern ("mode") in the measured positions with an unknown small amplitude; with a
normal prior on the amplitude it is marginalised exactly by adding sd^2 u u^T to the
covariance. Intervals then contain it, and no residual of this shape is taken for physics.
"""

import math

import numpy as np

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.numerics.random_patterns import SMALLEST, alone, random_patterns
from galileo_jax.observation.observation import Observation
from galileo_jax.similarity.hit_discrepancy import after_hits
from galileo_jax.similarity.rocking_discrepancy import rocking, rocking_frames, rocking_steps

POINT_SD_M = 0.003  # how far a marked point is from the centre
OFFSET_SD_M = 0.01  # of the whole track of one object: origin, point, level of the table
KEYSTONE_SD = 0.006  # 1/m; half a degree of yaw or tilt, 1.5 m away
CAMERA_M = 1.5  # a longer fall is seen from further away, at least its own length
ROLL_SD_RAD = 0.002
THROW_SD_RAD = 0.05  # nobody throws square to the camera: what comes nearer grows
# Lenses of phones and camcorders magnify the picture's edge by up to a hundredth more, about a
# centre which is not quite the motion's; what is thrown is filmed to fill the picture.
LENS_SD, LENS_CENTRE_SD = 0.005, 0.3
READ_OFF = 10.0  # times an angle's sd: so wide that the direction tells nothing more
SCALE_SD = 0.001  # of a scale of which nobody says how well it is known; of gravity, as well
# Bodies rock, sink into contacts and are lifted at a hit, across their path, by some tenths of a
# millimetre; how fast they go along it shows none of that.
WOBBLE_SD_M, WOBBLE_S = 4e-4, 0.3
# How much of that a track has is not known before. What is allowed for, of the noise's size and not
# there, makes the noise seem smaller than it is. So ten times as much is allowed for in what is not
# smooth: it says nothing of how large the noise is, and the path's shape is known as before.
ROUGH_SD_M, SMOOTH_DEGREE = 4e-3, 3
SAME_PLACE_M = 1e-3  # what moved by less has no shape of a path
ALIKE = 1e-6  # shapes that differ by less are one
# Several cameras place a body in space by where each sees it: how they stand to each other, their
# lenses and clocks shift it by a few millimetres, ever another way as it goes.
WANDER_SD_M, WANDER_S = 2e-3, 0.15
# Nothing holds a falling body to its line: where it is across it says nothing of the fall.
ASIDE_SD_M = 1.0


def offsets(observation: Observation) -> list[np.ndarray]:
    """The modes of a track as a whole: with these alone, displacements are what counts."""
    place, found = observation.position_m, []
    for i, axis in np.ndindex(place.shape[:2]):
        if not observation.mask[i].any():  # in a first part of a clip
            continue
        # Paths begin where the object is first seen, within that frame's error.
        seen = int(np.argmax(observation.mask[i]))
        error = observation.covariance_m2[i, axis, axis, seen]
        found.append(alone(place, i, axis, math.sqrt(OFFSET_SD_M**2 + error)))
    return found


def wander(
    observation: Observation,
    sd_m: float = WANDER_SD_M,
    lasts_s: float = WANDER_S,
    smallest: float = SMALLEST,
) -> list[np.ndarray]:
    """For each object and axis of a track a slow wander (Ornstein-Uhlenbeck)."""
    apart = np.abs(observation.times_s[:, None] - observation.times_s)
    patterns = random_patterns(sd_m**2 * np.exp(-apart / lasts_s), smallest)
    place = observation.position_m
    each = np.ndindex(place.shape[:2])
    return [alone(place, i, axis, own) for i, axis in each for own in patterns]


def modes(
    observation: Observation,
    scene: Surroundings,
    is_filmed: bool = True,
    rough_sd_m: float = ROUGH_SD_M,
) -> np.ndarray:
    """The patterns times their standard deviations, `[mode, object, 2, frame]`, m.

    Offsets of each object and axis; keystone about either axis, roll and scale of the
    camera, common to all objects; and, for what comes down a ramp, the step that an
    off-centre point and a box's length make when the object turns at the foot.
    After a hit the way each object goes is known to a tenth of a per cent. What only cameras
    and trackers do (keystone, roll, scale, a drift past a hit) is among them if `is_filmed`.

    `is_filmed`: whether a camera took it. `rough_sd_m`: allowed for across the path beside the
    wobble; 0 to draw tracks.
    """
    position = np.nan_to_num(observation.position_m)
    found = offsets(observation)
    if is_filmed:
        found.extend(camera(position, observation, scene))
    # A ramp's angle known within so much was read off the picture or the path: the direction
    # there, used already, must not count again.
    lean = READ_OFF * scene.angle_sd_rad if scene.has_surface else 0.0
    roll = math.hypot(ROLL_SD_RAD if is_filmed else 0.0, lean)
    if roll:
        x, y = position[:, 0], position[:, 1]
        found.append(roll * np.stack([-y, x], axis=1))
    for i, comes_down in enumerate(scene.comes_down):
        if comes_down:
            share = _share_past_foot(position[i, 0], scene, i)
            cos, sin = math.cos(scene.angle_rad), math.sin(scene.angle_rad)
            edge = scene.half_length_m[i] / 2 * (1 - cos)
            along = math.hypot(POINT_SD_M * sin, edge)
            across = math.hypot(POINT_SD_M * (1 - cos), edge)
            sds = enumerate((along, across))
            found += [alone(position, i, axis, sd * share) for axis, sd in sds]
    found.extend(across_path(observation, scene, rough_sd_m))
    if not scene.has_surface and not scene.moves_in_plane:  # any place across a fall
        each = np.ndindex(len(position), position.shape[-1])
        found += [alone(position, i, 0, ASIDE_SD_M, slice(f, f + 1)) for i, f in each]
    found.extend(after_hits(position, observation, is_filmed))
    for i in range(len(position)):
        found.extend(rocking_steps(position, scene, i, _rocks(position, observation, scene, i)))
    return np.stack(found)


def camera(position: np.ndarray, observation: Observation, scene: Surroundings) -> list[np.ndarray]:
    """Keystone about either axis, the lens and scale, of all objects; none where declared.

    How well the scale is known is inferred with the rest where it is stated (`declared_scale`).
    """
    if observation.is_squared:
        return []
    found = []
    x, y = position[:, 0], position[:, 1]
    if scene.has_surface:
        found.append(KEYSTONE_SD * np.stack([x * x, x * y], axis=1))
        found.append(KEYSTONE_SD * np.stack([x * y, y * y], axis=1))
    elif scene.moves_in_plane:
        # Anywhere in the picture: about the middle of what is seen of the flight.
        seen = observation.mask[:, None].repeat(2, axis=1)
        middle = np.ma.masked_array(position, ~seen).mean(axis=-1, keepdims=True).filled(0.0)
        aside = position - middle
        away_m = max(CAMERA_M, float(np.ptp(np.where(seen, position, middle), axis=-1).max()))
        yaw_sd = math.hypot(KEYSTONE_SD, THROW_SD_RAD / away_m)
        for axis, sd in enumerate((yaw_sd, KEYSTONE_SD)):
            found.append(sd * aside * aside[:, axis : axis + 1])
        found.extend(_lens(aside, seen))
    else:
        found.append(_bent_scale(y, observation))
    if not scene.is_scale_stated:
        found.append(SCALE_SD * position)
    return found


def _lens(aside: np.ndarray, seen: np.ndarray) -> list[np.ndarray]:
    """A lens that magnifies what is further out more (or less): r (1 + k r^2).

    About a centre c that is not the middle of the motion, to first order in c:
    k (r^2 r - r^2 c - 2 (r.c) r); r is 1 at the furthest point seen. `aside`: places about the
    middle of the motion.
    """
    edge_m = np.abs(np.where(seen, aside, 0.0)).max()
    if not edge_m:
        return []
    place = aside / edge_m
    square = (place**2).sum(axis=1, keepdims=True)
    found = [LENS_SD * edge_m * square * place]
    for axis in range(2):
        shift = 2.0 * place * place[:, axis : axis + 1]
        shift[:, axis] += square[:, 0]
        found.append(LENS_SD * LENS_CENTRE_SD * edge_m * shift)
    return found


def across_path(
    observation: Observation, scene: Surroundings, rough_sd_m: float = ROUGH_SD_M
) -> list[np.ndarray]:
    """For each object what it does across its path: a wobble, and more that is not smooth.

    The wobble is an Ornstein-Uhlenbeck process. None where no surface leads a body, nor where it
    is seen from above or in space.
    """
    if not scene.has_surface or scene.is_level or observation.position_m.shape[1] != 2:
        return []
    position = np.nan_to_num(observation.position_m)
    apart = np.abs(observation.times_s[:, None] - observation.times_s)
    wobble = random_patterns(WOBBLE_SD_M**2 * np.exp(-apart / WOBBLE_S))
    # What is faster than the wobble has no allowance: it is the tracker's noise alone.
    size_m = np.linalg.norm(wobble, axis=1)
    shapes = wobble / size_m[:, None]
    found = []
    for i, corner in enumerate(scene.corner_m):
        x = position[i, 0]
        is_on_ramp = np.broadcast_to(
            scene.comes_down[i] & (x < corner) | (not scene.has_table), x.shape
        )
        slope = np.where(is_on_ramp, scene.angle_rad, 0.0)
        normal = np.stack([np.sin(slope), np.cos(slope)])
        rough = shapes @ _not_smooth(x, is_on_ramp, observation.mask[i]) @ shapes.T
        every = random_patterns(np.diag(size_m**2) + rough_sd_m**2 * rough, smallest=0.0)
        for pattern in every @ shapes:
            away = np.zeros_like(position)
            away[i] = pattern * normal
            found.append(away)
    return found


def _not_smooth(x: np.ndarray, is_on_ramp: np.ndarray, seen: np.ndarray) -> np.ndarray:
    """`[frame, frame]`, what a cubic over the ramp and one over the table leave of a path.

    The ramp's direction, and a tilt of the table, are in the cubics.
    """
    powers = np.vander((x - x.mean()) / max(float(np.ptp(x)), SAME_PLACE_M), SMOOTH_DEGREE + 1)
    both = np.concatenate([powers * is_on_ramp[:, None], powers * ~is_on_ramp[:, None]], axis=1)
    both = both * seen[:, None]
    shapes, size, _ = np.linalg.svd(both, full_matrices=False)
    shapes = shapes[:, size > ALIKE * size[0]]
    return np.eye(len(x)) - shapes @ shapes.T


def _bent_scale(y: np.ndarray, observation: Observation) -> np.ndarray:
    """Keystone of a fall, whose scale was set for its whole length: right at both ends."""
    ends = y[observation.mask].max(), y[observation.mask].min()
    keystone = KEYSTONE_SD * CAMERA_M / max(CAMERA_M, ends[0] - ends[1])
    bend = keystone * (y - ends[0]) * (y - ends[1])
    return np.stack([np.zeros_like(y), bend], axis=1)


def crossings(observation: Observation, scene: Surroundings) -> np.ndarray:
    """Modes of each single frame in which an object lies across the foot, as `modes`.

    A box then rests on two edges, its centre above the point mass's path by up to
    (length / 4) sin(angle); half of that is taken as the standard deviation.
    """
    position = np.nan_to_num(observation.position_m)
    found = []
    for i, comes_down in enumerate(scene.comes_down):
        if comes_down:
            share = _share_past_foot(position[i, 0], scene, i)
            frames = np.flatnonzero((share > 0) & (share < 1) & observation.mask[i])
            size = scene.half_length_m[i] / 4 * math.sin(scene.angle_rad)
            each = ((axis, slice(frame, frame + 1)) for axis in range(2) for frame in frames)
            found += [alone(position, i, axis, size, frame) for axis, frame in each]
        found += rocking_frames(position, scene, i, _rocks(position, observation, scene, i))
    return np.array(found).reshape(-1, *position.shape)


def _rocks(
    position: np.ndarray, observation: Observation, scene: Surroundings, i: int
) -> list[tuple[slice, float]]:
    """When object i rocks, once it is past the foot, and how high."""
    if not scene.has_table:
        return []
    past = np.ones(position.shape[-1], bool)
    if scene.comes_down[i]:
        past = _share_past_foot(position[i, 0], scene, i) == 1
    return rocking(position, observation, scene, i, past)


def _share_past_foot(x: np.ndarray, scene: Surroundings, i: int) -> np.ndarray:
    """Which share of object i's length is past the foot, `[frame]`."""
    half = scene.half_length_m[i] * 1.2  # a frame's blur and a point off the centre
    return np.clip((x - scene.corner_m[i] + half) / (2 * half), 0.0, 1.0)

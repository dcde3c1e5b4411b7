"""How bodies on a path moved, from their measured places: random deviations build on it.

Deviations are small, so that their own speed does not change how fast a body crosses a surface;
and a covariance that comes from the data alone is the same for every hypothesis.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float

from galileo_jax.model.effects.effect import Surroundings
from galileo_jax.observation.observation import Observation

AROUND = 2  # frames to either side that tell a speed
STILL_M_S = 0.02  # what is slower rests
CLEAR = 3.0  # standard deviations of a speed
MOVED_M = 0.002  # an object that has gone so far has been hit
NEAR_M = 0.006  # boxes that turn a little about the vertical touch at such gaps between faces
BEFORE, AFTER = 3, 4  # frames that tell speeds at a hit


@dataclass(frozen=True)
class Hit:
    """One body that meets the next one, which rests."""

    step: int  # the hit is between frames `step` and `step + 1`
    rear: int  # the bodies
    front: int
    kept: float  # speeds after it over the rear's before it
    given: float
    lost_m_s: float  # by which the rear's and the front's speed change
    gained_m_s: float
    near: Bool[np.ndarray, " step"]  # steps in which faces of the two are near each other


@dataclass(frozen=True)
class Kinematics:
    """Measured motion along a path."""

    times_s: Float[np.ndarray, " frame"]
    # Past the foot; between measured places on straight lines
    path_m: Float[np.ndarray, "object frame"]
    # Unit vectors of the path, in the direction of travel
    tangent: Float[np.ndarray, "object axis frame"]
    speed_m_s: Float[np.ndarray, "object frame"]  # along the path; 0 at rest
    moves: Bool[np.ndarray, "object step"]  # whether each moves from frame to frame
    # What presses each onto the surface, over its mass
    normal_m_s2: Float[np.ndarray, "object frame"]
    hits: tuple[Hit, ...] = ()  # in time's order

    @property
    def step_s(self) -> Float[np.ndarray, " step"]:
        """From each frame to the next."""
        return np.diff(self.times_s)


def kinematics(observation: Observation, scene: Surroundings) -> Kinematics | None:
    """How bodies moved on a ramp, a table, a level; None where no surface leads them."""
    if not scene.has_surface or scene.is_level or observation.position_m.shape[1] != 2:
        return None
    times = observation.times_s
    count, frames = observation.mask.shape
    step = float(np.median(np.diff(times))) if frames > 1 else 1.0
    lever_s = step * math.sqrt(sum(2 * k * k for k in range(1, AROUND + 1)))  # errors: m to m/s
    angle, speed, place = np.zeros((3, count, frames))
    moves = np.zeros((count, max(frames - 1, 0)), bool)
    for i in range(count):
        x, y = _filled(observation, i)
        angle[i] = scene.angle_rad
        if scene.has_table:
            is_on_ramp = scene.comes_down[i] & (x < scene.corner_m[i])
            angle[i] = np.where(is_on_ramp, scene.angle_rad, 0.0)
        corner = scene.corner_m[i] if math.isfinite(scene.corner_m[i]) else 0.0
        place[i] = (x - corner) * np.cos(angle[i]) - y * np.sin(angle[i])
        speed[i] = np.abs(_slope(times, place[i]))
        least = max(STILL_M_S, CLEAR * _noise_m(observation, i) / lever_s)
        speed[i][speed[i] < least] = 0.0
        moves[i] = (speed[i, 1:] > 0) | (speed[i, :-1] > 0)
    tangent = np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    found = Kinematics(times, place, tangent, speed, moves, scene.gravity * np.cos(angle))
    return replace(found, hits=_hits(observation, place))


def velocities(observation: Observation) -> Float[np.ndarray, "object axis frame"]:
    """How fast bodies are seen to move, m/s; 0 of turning, which is no place."""
    found = np.zeros_like(observation.position_m)
    for i in range(len(found)):
        places = _filled(observation, i)
        for axis in range(found.shape[1] - int(observation.is_turning)):
            found[i, axis] = _slope(observation.times_s, places[axis])
    return found


def _filled(observation: Observation, i: int) -> np.ndarray:
    """`[2, frame]`, places; between measured ones on straight lines."""
    seen = np.flatnonzero(observation.mask[i])
    if not seen.size:
        return np.zeros_like(observation.position_m[i])
    every = np.arange(len(observation.times_s))
    return np.stack([np.interp(every, seen, own[seen]) for own in observation.position_m[i]])


def _noise_m(observation: Observation, i: int) -> float:
    """In the direction that is known best: across a path it may not be known at all."""
    seen = observation.mask[i]
    if not seen.any():
        return 0.0
    each = np.linalg.eigvalsh(np.moveaxis(observation.covariance_m2[i][:, :, seen], -1, 0))
    return float(np.sqrt(np.median(each[:, 0])))


def _slope(times_s: np.ndarray, place: np.ndarray) -> np.ndarray:
    """By least squares over `AROUND` frames to either side."""
    found = np.zeros(len(place))
    for frame in range(len(place)):
        own = slice(max(frame - AROUND, 0), frame + AROUND + 1)
        t = times_s[own] - times_s[own].mean()
        square = float(t @ t)
        found[frame] = t @ place[own] / square if square > 0 else 0.0
    return found


def first_moved(
    place_m: Float[np.ndarray, " frame"], seen: Bool[np.ndarray, " frame"]
) -> int | None:
    """The first frame in which a body that rested has left its place; None: it never does."""
    known = np.flatnonzero(seen)
    if not known.size:
        return None
    moved = seen & (np.abs(place_m - np.median(place_m[known[:3]])) > MOVED_M)
    return int(np.argmax(moved)) if moved.any() else None


def _hits(observation: Observation, place: np.ndarray) -> tuple[Hit, ...]:
    found = []
    for front in range(1, len(place)):
        moved = first_moved(place[front], observation.mask[front])
        if moved is not None and moved >= 2:
            hit = _hit(moved - 1, front, observation, place)
            found += [] if hit is None else [hit]
    return tuple(sorted(found, key=lambda hit: hit.step))


def _hit(step: int, front: int, observation: Observation, place: np.ndarray) -> Hit | None:
    """The hit before frame `step + 1`; None where speeds are not those of a hit."""
    times, rear = observation.times_s, front - 1

    def speed(body: int, frames: slice) -> float:
        t = times[frames]
        return float(np.polyfit(t - t.mean(), place[body, frames], 1)[0]) if len(t) > 1 else 0.0

    before, after = slice(max(step - BEFORE + 1, 0), step + 1), slice(step + 1, step + 1 + AFTER)
    came = speed(rear, before)
    if came < STILL_M_S:
        return None
    left, went = speed(rear, after), speed(front, after)
    apart = place[front] - place[rear]
    touching = apart[step : step + 3].min()
    close = np.flatnonzero(apart[step + 1 :] - touching < NEAR_M)
    near = np.zeros(len(times) - 1, bool)
    near[step + 1 : step + 1 + (int(close[-1]) + 1 if close.size else 0)] = True
    kept, given = np.clip([left / came, went / came], 0.0, [1.0, 2.0])
    return Hit(step, rear, front, kept, given, max(came - left, 0.0), max(went, 0.0), near)

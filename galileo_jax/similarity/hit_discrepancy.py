"""What bodies that are no points, and trackers, do at a hit, as covariance (see `discrepancy`)."""

from dataclasses import dataclass

import numpy as np

from galileo_jax.numerics.random_patterns import alone, random_patterns
from galileo_jax.observation.observation import Observation
from galileo_jax.statespace.kinematics import STILL_M_S, first_moved

IMPULSE_SD = 0.001  # of a hit's impulse: faces are never quite square to the travel
HIT_STEP_SD_M = 1e-4  # a real hit takes a millisecond or two, a rigid one none
# A soft hit takes this long to end: bodies that friction pulls apart meanwhile leave without the
# last of its impulse.
HIT_END_S = 0.005
MIN_FRAMES_APART = 4  # to tell how fast friction pulls bodies apart
HIT_DRIFT_SD_M, HIT_DRIFT_S = 2e-4, 0.15  # trackers are pulled along by what they pass
# Ours by nothing that 40 rendered clips show (without any drift errors were 0.55, 0.82 and 0.73 of
# the stated ones: k1, k2, log ratio).
OWN_DRIFT_SD_M = 5e-5
# Boxes turn a little at a hit, however straight, and while they are close a corner of one pushes
# the other on: they come apart, or together, otherwise than points do.
PUSH_SD_M_S2, PUSH_S = 0.05, 0.2
CLOSE_M = 0.008  # half of a box 60 mm deep, against another, each turned by some eight degrees


def after_hits(position: np.ndarray, observation: Observation, is_filmed: bool) -> list[np.ndarray]:
    """For each hit and who is in it a step, the way it goes from there; filmed, a slow drift."""
    found = []
    for i in range(1, len(position)):
        moved = first_moved(position[i, 0], observation.mask[i])
        if moved is not None:
            hit = max(moved - 1, 0)
            found.extend(_after(hit, (i - 1, i), position))
            found.extend(_at_the_hit(hit, i, position, observation))
            if is_filmed:
                found.extend(_drift(hit, (i - 1, i), position, observation))
    return found


def _after(hit: int, objects: tuple[int, int], position: np.ndarray) -> list[np.ndarray]:
    """What a hit in frame `hit` leaves behind in either object's motion."""
    found = []
    for i in objects:
        way = position[i, 0, hit:] - position[i, 0, hit]
        found.append(alone(position, i, 0, IMPULSE_SD * way, slice(hit, None)))
        found.append(alone(position, i, 0, HIT_STEP_SD_M, slice(hit + 1, None)))
    return found


@dataclass(frozen=True)
class _Hit:
    """A hit of two bodies in a frame, and how each goes on from there."""

    frame: int
    front: int  # the object that is hit; the one before hits it
    both: np.ndarray  # `[k]`, frames after it in which both are seen and move
    loses: float  # of the rear's speed, m/s; as the masses, the other way round
    gains: float  # of the front's
    pulled_apart: float  # by friction, m/s^2; negative where it presses the bodies together


def _at_the_hit(
    frame: int, front: int, position: np.ndarray, observation: Observation
) -> list[np.ndarray]:
    """What bodies that are no points do at a hit, which takes a while, and while they are close."""
    hit = _speeds_at(frame, front, position, observation)
    if hit is None:
        return []
    found = _pushes(hit, position, observation)
    if hit.pulled_apart > 0:  # a soft hit ends late, and lacks what friction changes meanwhile
        since = np.maximum(observation.times_s - observation.times_s[frame], 0.0)
        lacks_m = -hit.pulled_apart * HIT_END_S * since
        found.insert(0, _between(hit, lacks_m, position, observation))
    return found


def _speeds_at(
    frame: int, front: int, position: np.ndarray, observation: Observation
) -> _Hit | None:
    """The hit in `frame`; None where too little of it is seen, or it is no hit."""
    times = observation.times_s
    rear, ahead = position[front - 1, 0], position[front, 0]
    seen = observation.mask[front - 1] & observation.mask[front]
    moves = np.minimum(np.diff(rear), np.diff(ahead)) > STILL_M_S * np.diff(times)
    stops = frame + 1 + int(np.argmin(np.append(moves[frame + 1 :], False)))
    both = np.arange(frame + 1, stops)[seen[frame + 1 : stops]]
    if len(both) < MIN_FRAMES_APART or frame < 2 or not seen[frame - 2 : frame + 1].all():
        return None
    since = times[both] - times[frame]
    loses = np.polyfit(times[frame - 2 : frame + 1], rear[frame - 2 : frame + 1], 1)[0]
    loses -= np.polyfit(since, rear[both], 2)[1]
    gains = np.polyfit(since, ahead[both], 2)[1]
    if min(loses, gains) <= 0:
        return None
    bend = np.polyfit(since, (ahead - rear)[both], 2)[0]
    return _Hit(frame, front, both, float(loses), float(gains), 2 * float(bend))


def _pushes(hit: _Hit, position: np.ndarray, observation: Observation) -> list[np.ndarray]:
    """A slowly varying push between two bodies while they are close, and what comes of it."""
    times = observation.times_s
    apart = position[hit.front, 0] - position[hit.front - 1, 0]
    touching = apart[hit.both[:2]].min()
    is_far = apart[hit.both] - touching > CLOSE_M
    close = hit.both[: int(np.argmax(is_far)) if is_far.any() else None]
    if not close.size:  # they come closer by more than that from one frame to the next
        return []
    between_s = times[close][:, None] - times[close]
    found = []
    for pattern in random_patterns(PUSH_SD_M_S2**2 * np.exp(-0.5 * (between_s / PUSH_S) ** 2)):
        push = np.zeros(len(times))
        push[close] = pattern
        further = _integral(_integral(push, times), times)
        found.append(_between(hit, further, position, observation))
    return found


def _integral(values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """By trapezoids, from 0; `scipy.integrate` takes a sixth of a second to import."""
    return np.append(0.0, np.cumsum(np.diff(times) * (values[1:] + values[:-1]) / 2.0))


def _between(
    hit: _Hit, apart_m: np.ndarray, position: np.ndarray, observation: Observation
) -> np.ndarray:
    """The mode by which two bodies are `apart_m` `[frame]` further apart, momentum conserved.

    Each holds what it has when it comes to rest.
    """
    times, found = observation.times_s, np.zeros_like(position)
    total = hit.loses + hit.gains
    for i, share in ((hit.front - 1, -hit.loses / total), (hit.front, hit.gains / total)):
        speed = np.append(np.diff(position[i, 0]) / np.diff(times), 0.0)
        rests = hit.frame + 1 + int(np.argmin(speed[hit.frame + 1 :] > STILL_M_S))
        upto = np.minimum(np.arange(len(times)), rests)
        found[i, 0, hit.frame + 1 :] = share * apart_m[upto][hit.frame + 1 :]
    return found


def _drift(
    hit: int, objects: tuple[int, int], position: np.ndarray, observation: Observation
) -> list[np.ndarray]:
    """What a hit in frame `hit` leaves behind in either object's track."""
    after = observation.times_s[hit + 1 :]
    apart_s = (after[:, None] - after) / HIT_DRIFT_S
    sd_m = OWN_DRIFT_SD_M if observation.is_tracked_here else HIT_DRIFT_SD_M
    patterns = random_patterns(sd_m**2 * np.exp(-0.5 * apart_s**2))
    after_hit = slice(hit + 1, None)
    return [alone(position, i, 0, own, after_hit) for i in objects for own in patterns]

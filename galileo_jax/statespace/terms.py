"""The terms: what no model knows, of bodies on a path and in the air, and of their marks."""

from collections.abc import Callable

import numpy as np

from galileo_jax.statespace.kinematics import velocities
from galileo_jax.statespace.linear_sde import covariance, transitions
from galileo_jax.statespace.path_deviation import deviations
from galileo_jax.statespace.term import FromSeen, Patterns, Seen, Term, along_path, of_axis

LASTS, BRIEFLY = 1 / 3, 3.0  # of the track; rows
ROUGHNESS, ROUGH_LENGTH_M = "friction_roughness", 0.01
GUST_S = 0.05

TERMS: dict[str, Term] = {}
"""By name, in the order of their sizes."""


def _term(
    meaning: str,
    unit: str,
    median: Callable[[Seen], float],
    factor: float,
    is_of_marks: bool = False,
) -> Callable[[FromSeen], FromSeen]:
    """Decorates what makes a term's patterns; it returns None where it has no place."""

    def registered(made: FromSeen) -> FromSeen:
        name = made.__name__
        TERMS[name] = Term(name, meaning, unit, median, factor, made, is_of_marks)
        return made

    return registered


def _frame_s(seen: Seen) -> float:
    steps = np.diff(seen.observation.times_s)
    return float(np.median(steps)) if steps.size else 1.0


def _share_of_way_m(seen: Seen) -> float:
    """Of the longest way of a body between two of its places: as far as marks may be told apart."""
    longest = 1e-3
    for mask, place in zip(seen.observation.mask, seen.observation.position_m, strict=True):
        if mask.any():
            longest = max(longest, float(np.linalg.norm(np.ptp(place[:2, mask], axis=1))))
    return 2e-4 * longest


def _smooth(seen: Seen, lasts_s: float) -> Patterns:
    """Of Matern's process, nu = 3/2, in each axis of each body.

    Source: Rasmussen and Williams (2006), Gaussian Processes for Machine Learning, section 4.2.1.
    """
    times = seen.observation.times_s
    apart = np.sqrt(3) * np.abs(times[:, None] - times) / max(lasts_s, 1e-9)
    return of_axis((1 + apart) * np.exp(-apart), seen)


@_term("the marks are off by {size} for some frames", "m", _share_of_way_m, 5.0, is_of_marks=True)
def brief_error(seen: Seen) -> Patterns:
    """Errors over three rows: blur, an encoder."""
    return _smooth(seen, BRIEFLY * _frame_s(seen))


@_term(
    "two bodies that are near each other change their relative speed by {size} in a second",
    "m/s",
    lambda _: 0.03,
    3.0,
)
def contact_push(seen: Seen) -> Patterns | None:
    """White accelerations of two bodies against each other, while they are near after a hit."""
    motion = seen.motion
    if motion is None or not motion.hits:
        return None
    count = len(motion.moves)
    pushed = np.zeros((len(motion.times_s) - 1, count, count))
    for hit in motion.hits:
        total = hit.lost_m_s + hit.gained_m_s
        if total > 0:  # speeds change as the inverse of the masses
            way = np.zeros(count)
            way[[hit.rear, hit.front]] = -hit.lost_m_s / total, hit.gained_m_s / total
            pushed[hit.near] += np.outer(way, way)
    return along_path(deviations(motion, pushed=pushed), motion)


@_term("the friction coefficient varies by {size} along the way", "1", lambda _: 0.005, 3.0)
def friction_roughness(seen: Seen) -> Patterns | None:
    """Friction that varies along the way, as on every board; none of what rests.

    Of what rolls it is the resistance to rolling that varies.
    """
    motion = seen.motion
    if motion is None or not motion.moves.any():
        return None
    return along_path(deviations(motion, ROUGH_LENGTH_M, 1.0), motion)


@_term(
    "accelerations vary by {size} for a twentieth of a second at a time",
    "m/s^2",
    lambda _: 0.02,
    4.0,
)
def gusts(seen: Seen) -> Patterns | None:
    """Accelerations in each axis, as of air that moves; none on a surface, a spring or a thread."""
    scene, times = seen.scene, seen.observation.times_s
    if scene.has_surface or len(times) < 2 or {"spring", "pendulum"} & set(scene.laws):
        return None
    drift, diffusion = np.zeros((2, len(times) - 1, 3, 3))
    drift[:, 0, 1] = drift[:, 1, 2] = 1.0
    drift[:, 2, 2] = -1 / GUST_S
    diffusion[:, 2, 2] = 2 / GUST_S
    place = np.tile([[1.0, 0.0, 0.0]], (len(times), 1, 1))
    way = transitions(drift, diffusion, np.diff(times))
    found = covariance(way, np.diag([0.0, 0.0, 1.0]), place)
    return of_axis(found[:, 0, :, 0], seen)


@_term(
    "a share of {size} of a hit's impulse does not stay between the two bodies",
    "1",
    lambda _: 0.005,
    3.0,
)
def hit_impulse(seen: Seen) -> Patterns | None:
    """Jumps of the speeds of both at a hit: friction, or tipping, takes or gives momentum."""
    motion = seen.motion
    if motion is None or not motion.hits:
        return None
    jumps = np.zeros((len(motion.times_s) - 1, len(motion.moves)))
    for hit in motion.hits:
        jumps[hit.step, [hit.rear, hit.front]] += hit.lost_m_s, hit.gained_m_s
    return along_path(deviations(motion, jumps=jumps), motion)


@_term(
    "the marks are off by {size} for a third of the time",
    "m",
    _share_of_way_m,
    5.0,
    is_of_marks=True,
)
def lasting_error(seen: Seen) -> Patterns:
    """Errors over a third of the track: lens, scale, the eye."""
    return _smooth(seen, LASTS * float(np.ptp(seen.observation.times_s)))


@_term(
    "times are off by {size} at random",
    "s",
    lambda seen: 0.01 * _frame_s(seen),
    4.0,
    is_of_marks=True,
)
def late_times(seen: Seen) -> Patterns:
    """Times off at random, of each frame by another amount, which shifts bodies by v dt.

    Clocks of phones, times printed in milliseconds, pictures that were exposed for long.
    """
    velocity = velocities(seen.observation)
    shifts = np.einsum("oat,tk->koat", velocity, np.eye(velocity.shape[-1]))
    return shifts[np.abs(shifts).max(axis=(1, 2, 3)) > 0]

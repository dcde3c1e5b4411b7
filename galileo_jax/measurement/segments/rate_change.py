"""Where a film goes over to slow motion: its clock changes, and the motion does not.

From one frame to the next, without a bend of the path, the velocity changes by a factor r and the
acceleration by r^2. What is braked or struck keeps the acceleration that gravity and friction give.
On both sides a parabola must leave nothing but noise, and one path of two accelerations, whose
velocity does not jump, must leave more.
"""

from typing import NamedTuple

import numpy as np

from galileo_jax.numerics.least_squares import least_squares
from galileo_jax.observation.observation import Observation, PointPath

LEAST, CLEAR = 1.5, 4.0  # factor of the velocity; standard deviations
STRAIGHT, UNLIKE = 0.98, 0.3  # cosine between the velocities; share of the accelerations
FEWEST = 8  # places on either side
REACHES = (20, FEWEST)  # the shorter not to where it is at rest or struck
MOST_LEFT = 3.0  # times the stated variance
STARTS = 5  # to a step, that are tried
SMEARED = 1  # steps in which the clock changes


def rate_change(observation: Observation) -> tuple[int, float] | None:
    """The last frame before object 1's clock changes, and by what velocities are larger after it.

    None where it does not change.
    """
    path, found = observation.path(), []
    away = observation.first_away(0)
    let_go = 0 if away is None else int(np.searchsorted(path.frames, away))
    for at in range(FEWEST, len(path) - FEWEST - SMEARED + 1):
        middle_s = (path.times_s[at - 1] + path.times_s[at]) / 2
        before = _smooth([path[max(at - n, 0) : at] for n in REACHES], middle_s)
        if before.left >= MOST_LEFT and at < let_go + FEWEST:
            before = _from_rest(path[max(at - REACHES[0], 0) : at], middle_s)
        after = _smooth([path[at + SMEARED : at + SMEARED + n] for n in REACHES], middle_s)
        if max(before.left, after.left) < MOST_LEFT and (factor := _factor(before, after)):
            both = path[at - before.places : at + SMEARED + after.places]
            if not _kinked_left(both, float(np.median(path.variance_m2))) < MOST_LEFT:
                found.append((before.left + after.left, int(path.frames[at - 1]), factor))
    return min(found)[1:] if found else None


def _smooth(sides: list[PointPath], middle_s: float) -> "_Parabola":
    """Of the first side of which a parabola leaves noise alone, or of the last."""
    found = (_parabola(side, middle_s) for side in sides[:-1])
    good = next((one for one in found if one.left < MOST_LEFT), None)
    return good or _parabola(sides[-1], middle_s)


class _Parabola(NamedTuple):
    """At some time, m and s, through so many `places`; `left`: variance over the stated one."""

    velocity: np.ndarray
    acceleration: np.ndarray
    places: int
    left: float
    velocity_sd: float
    acceleration_sd: float


def _parabola(path: PointPath, middle_s: float) -> _Parabola:
    fit = path.polynomial(2, middle_s)
    bend, velocity, _ = fit.solution
    sds = np.sqrt(np.diagonal(fit.inverse)[1::-1]) * (1, 2)
    known = _left_and_sds(path, fit.left, fit.solution.size, sds)
    return _Parabola(velocity, 2 * bend, len(path), *known)


def _from_rest(path: PointPath, middle_s: float) -> _Parabola:
    """Of what is at rest until it is let go: place + acceleration since^2 / 2, since >= 0.

    When it is let go is looked for; the errors are by the slopes of all three.
    """
    times, place = path.times_s, path.place_m.T
    starts = np.linspace(times[1], times[-2], STARTS * len(path))
    since = np.maximum(times - starts[:, None], 0.0)
    fits = [least_squares(np.column_stack([np.ones_like(s), s**2 / 2]), place) for s in since]
    best = int(np.argmin([np.sum(fit.left**2) for fit in fits]))
    acceleration, moved_s = fits[best].solution[1], since[best]
    size, gone_s = float(np.linalg.norm(acceleration)), middle_s - starts[best]
    slopes = np.column_stack([np.ones_like(moved_s), moved_s**2 / 2, -size * moved_s])
    inverse, of_velocity = np.linalg.pinv(slopes.T @ slopes), np.array([0.0, gone_s, -size])
    sds = np.sqrt([of_velocity @ inverse @ of_velocity, inverse[1, 1]])
    known = _left_and_sds(path, fits[best].left, fits[best].solution.size + 1, sds)
    return _Parabola(acceleration * gone_s, acceleration, len(path), *known)


def _left_and_sds(
    path: PointPath, left: np.ndarray, num_unknowns: int, sds: np.ndarray
) -> tuple[float, ...]:
    """The variance left over the stated one, and what `sds` for places of sd 1 are with it."""
    variance = float(np.median(path.variance_m2))
    over = float(np.sum(left**2)) / ((left.size - num_unknowns) * variance)
    return over, *(np.sqrt(variance * max(over, 1.0)) * sds).tolist()


def _kinked_left(path: PointPath, variance_m2: float) -> float:
    """What the best path leaves whose acceleration changes once, over the stated variance."""
    since = path.times_s - path.times_s[0]
    kinks = (np.maximum(since - kink_s, 0.0) ** 2 for kink_s in since[2:-2])
    designs = (np.column_stack([np.vander(since, 3), kink]) for kink in kinks)
    left = min(float(np.sum(least_squares(each, path.place_m.T).left ** 2)) for each in designs)
    return left / (variance_m2 * len(path.place_m) * (len(since) - 5))


def _factor(before: _Parabola, after: _Parabola) -> float | None:
    """By what the clock runs slower after than before; None where another thing happens."""
    slow, fast = (float(np.linalg.norm(one.velocity)) for one in (before, after))
    if slow < CLEAR * before.velocity_sd or fast < CLEAR * after.velocity_sd:
        return None
    factor, known = fast / slow, float(np.hypot(after.velocity_sd, before.velocity_sd))
    if max(factor, 1 / factor) < LEAST or abs(fast - slow) < CLEAR * known:
        return None
    if before.velocity @ after.velocity < STRAIGHT * slow * fast:
        return None
    expected = factor**2 * before.acceleration
    apart = float(np.linalg.norm(after.acceleration - expected))
    size = max(float(np.linalg.norm(one)) for one in (after.acceleration, expected))
    shows = CLEAR * float(np.hypot(after.acceleration_sd, factor**2 * before.acceleration_sd))
    return factor if apart < min(shows, UNLIKE * size) else None

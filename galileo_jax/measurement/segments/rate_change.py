"""Where a film goes over to slow motion: its clock changes, and the motion does not.

From one frame to the next, without a bend of the path, the velocity changes by a factor r and the
acceleration by r^2. What is braked or struck keeps the acceleration that gravity and friction give.
On both sides a parabola must leave nothing but noise, and one path of two accelerations, whose
velocity does not jump, must leave more.
"""

from typing import NamedTuple

import numpy as np

from galileo_jax.observation.observation import Observation

LEAST, CLEAR = 1.5, 4.0  # factor of the velocity; standard deviations
STRAIGHT, UNLIKE = 0.98, 0.3  # cosine between the velocities; share of the accelerations
FRAMES, FEWEST = 20, 8  # on either side
MOST_LEFT = 3.0  # times the stated variance
SMEARED = 1  # steps in which the clock changes


class RateChange(NamedTuple):
    """The last frame before it, and by what velocities are larger after it."""

    last: int
    factor: float


def rate_change(observation: Observation) -> RateChange | None:
    """Where the clock of object 1's track changes; None where it does not."""
    path = observation.path()
    times_s, place_m, noise = path.times_s, path.place_m, np.sqrt(path.variance_m2)
    best: tuple[float, RateChange] | None = None
    for at in range(FEWEST, len(path) - FEWEST - SMEARED + 1):
        sides = slice(max(at - FRAMES, 0), at), slice(at + SMEARED, at + SMEARED + FRAMES)
        middle_s = (times_s[at - 1] + times_s[at]) / 2
        before, after = (
            _parabola(times_s[side] - middle_s, place_m[:, side], float(np.median(noise[side])))
            for side in sides
        )
        left = before.left + after.left
        is_smooth = max(before.left, after.left) < MOST_LEFT
        factor = _factor(before, after) if is_smooth else None
        both = slice(sides[0].start, sides[1].stop)
        if factor is not None and _kinked_left(times_s[both], place_m[:, both], noise) < MOST_LEFT:
            factor = None
        if factor is not None and (best is None or left < best[0]):
            best = left, RateChange(int(path.frames[at - 1]), factor)
    return best[1] if best else None


class _Parabola(NamedTuple):
    velocity: np.ndarray
    acceleration: np.ndarray
    velocity_sd: float
    acceleration_sd: float
    left: float  # variance that it leaves, over the stated one


def _parabola(since_s: np.ndarray, place_m: np.ndarray, noise_m: float) -> _Parabola:
    """Velocity and acceleration at 0, with the standard deviation of a coordinate of each."""
    design = np.vander(since_s, 3)
    solution = np.linalg.lstsq(design, place_m.T, rcond=None)[0]
    left = float(np.sum((place_m.T - design @ solution) ** 2))
    left /= (len(since_s) - 3) * len(place_m) * noise_m**2
    scatter = noise_m**2 * max(left, 1.0)
    sds = np.sqrt(scatter * np.diagonal(np.linalg.inv(design.T @ design)))
    return _Parabola(solution[1], 2 * solution[0], float(sds[1]), 2 * float(sds[0]), left)


def _kinked_left(times_s: np.ndarray, place_m: np.ndarray, noise_m: np.ndarray) -> float:
    """What the best path leaves whose acceleration changes once, over the stated variance."""
    since = times_s - times_s[0]
    variance = float(np.median(noise_m)) ** 2
    left = []
    for kink_s in since[2:-2]:
        design = np.column_stack([np.vander(since, 3), np.maximum(since - kink_s, 0.0) ** 2])
        solution = np.linalg.lstsq(design, place_m.T, rcond=None)[0]
        left.append(float(np.sum((place_m.T - design @ solution) ** 2)))
    return min(left) / (variance * len(place_m) * (len(since) - 5))


def _factor(before: _Parabola, after: _Parabola) -> float | None:
    """By what the clock runs slower after than before; None where another thing happens."""
    speeds = [float(np.linalg.norm(one.velocity)) for one in (before, after)]
    if any(v < CLEAR * one.velocity_sd for v, one in zip(speeds, (before, after), strict=True)):
        return None
    factor = speeds[1] / speeds[0]
    known = float(np.hypot(after.velocity_sd, before.velocity_sd))
    if max(factor, 1 / factor) < LEAST or abs(speeds[1] - speeds[0]) < CLEAR * known:
        return None
    if before.velocity @ after.velocity < STRAIGHT * speeds[0] * speeds[1]:
        return None
    expected = factor**2 * before.acceleration
    apart = float(np.linalg.norm(after.acceleration - expected))
    size = max(float(np.linalg.norm(one)) for one in (after.acceleration, expected))
    shows = CLEAR * float(np.hypot(after.acceleration_sd, factor**2 * before.acceleration_sd))
    return factor if apart < min(shows, UNLIKE * size) else None

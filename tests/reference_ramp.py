"""The ramp experiment in closed form: an oracle that shares nothing with the package.

Boxes are points with Coulomb friction, moved from event to event; between events the
acceleration is constant, so every position is exact.

    path     object 1's centre runs parallel to ramp and table at half its height; the two
             lines meet above x = (h1 / 2) tan(a / 2).
    ramp     q'' = g (sin a - k1 cos a), or at rest where k1 >= tan a.
    foot     the impulse that turns the motion also brakes it: v+ = v- max(0, cos a - k1 sin a).
    table    q'' = -k g until at rest.
    hit      when the boxes' faces meet; plastic: both go on at m1 v / (m1 + m2).
    after    k1 < k2: object 2 brakes harder, object 1 keeps pushing it, both at
             -(k1 m1 + k2 m2) g / (m1 + m2). Otherwise they part, each at its own -k g.

The pitch has no closed form in a world of points; object 1 is drawn turning from -a to 0
at an even rate per metre while its length passes the foot. Nothing else depends on it.

Axes as in the package: x along the travel, y up, origin at the foot of the ramp.
"""

from dataclasses import dataclass
from math import cos, inf, sin, sqrt, tan

import numpy as np


@dataclass(frozen=True)
class Experiment:
    """One ramp experiment."""

    # of object 1 and object 2
    mass_kg: tuple[float, float]
    friction: tuple[float, float]
    angle_rad: float  # of the ramp, in (0, pi / 2)
    # (length along the travel, height) of each object
    size_m: tuple[tuple[float, float], tuple[float, float]]
    # distance along the ramp from its foot up to the point under object 1's centre at t = 0, where
    # it is let go at rest
    release_m: float
    object2_x_m: float | None  # where object 2's centre stands; None = there is no object 2
    gravity: float = 9.81  # m/s^2


@dataclass(frozen=True)
class Piece:
    """Motion along the path from `start_s` on: q, q' and the constant q''."""

    start_s: float
    q_m: float
    speed_m_s: float
    acceleration_m_s2: float

    def at(self, time_s: float) -> tuple[float, float]:
        """Returns (q, q') at `time_s`."""
        elapsed = time_s - self.start_s
        return (
            self.q_m + self.speed_m_s * elapsed + self.acceleration_m_s2 * elapsed**2 / 2,
            self.speed_m_s + self.acceleration_m_s2 * elapsed,
        )

    def reaches(self, q_m: float) -> float:
        """Returns the first time at which the piece is at `q_m` ahead of it; inf if never."""
        distance, speed, acceleration = q_m - self.q_m, self.speed_m_s, self.acceleration_m_s2
        under_root = speed**2 + 2 * acceleration * distance
        if under_root < 0 or (speed == 0 and acceleration <= 0):
            return inf
        # The usual formula times its conjugate: no cancellation, and acceleration may be zero.
        return self.start_s + 2 * distance / (speed + sqrt(under_root))

    def rests(self) -> float:
        """Returns the time at which the piece comes to rest; inf if it never does."""
        if self.speed_m_s == 0 and self.acceleration_m_s2 == 0:
            return self.start_s
        if self.acceleration_m_s2 >= 0:
            return inf
        return self.start_s - self.speed_m_s / self.acceleration_m_s2


@dataclass(frozen=True)
class Solution:
    """The motion at the times asked for."""

    times_s: np.ndarray  # `[time]`, s since the release
    # `[object, 2, time]`, m and m/s
    position_m: np.ndarray
    velocity_m_s: np.ndarray
    pitch_rad: np.ndarray  # `[object, time]`, counter-clockwise positive
    # when object 1's centre turned, and when it met object 2; None = never
    foot_s: float | None
    hit_s: float | None


def solve(experiment: Experiment, times_s: np.ndarray) -> Solution:
    """Returns the exact motion at `times_s`.

    Raises:
      ValueError: object 1 would meet object 2 before its centre is past the foot, or stands
        below the foot at the start.
    """
    angle, gravity = experiment.angle_rad, experiment.gravity
    k1, k2 = experiment.friction
    m1, m2 = experiment.mass_kg
    corner_m = experiment.size_m[0][1] / 2 * tan(angle / 2)
    start_q = corner_m - experiment.release_m
    if start_q >= 0:
        raise ValueError("object 1 stands at or below the foot")

    pull = gravity * (sin(angle) - k1 * cos(angle))
    first = [Piece(0.0, start_q, 0.0, max(0.0, pull))]
    second = [Piece(0.0, 0.0, 0.0, 0.0)]

    foot_s = first[-1].reaches(0.0)
    if foot_s < inf:
        speed = first[-1].at(foot_s)[1] * max(0.0, cos(angle) - k1 * sin(angle))
        first += _braked(foot_s, 0.0, speed, k1 * gravity)

    hit_s = inf
    if experiment.object2_x_m is not None:
        gap = experiment.object2_x_m - (experiment.size_m[0][0] + experiment.size_m[1][0]) / 2
        hit_q = gap - corner_m
        if hit_q <= 0:
            raise ValueError("object 2 stands so close that it is met on the foot")
        if foot_s < inf:
            hit_s = first[1].reaches(hit_q)
    if hit_s < inf:
        speed = first[1].at(hit_s)[1] * m1 / (m1 + m2)
        together = gravity * (k1 * m1 + k2 * m2) / (m1 + m2)
        brake1, brake2 = (together, together) if k1 < k2 else (k1 * gravity, k2 * gravity)
        first[2:] = _braked(hit_s, hit_q, speed, brake1)
        second += _braked(hit_s, 0.0, speed, brake2)

    q1, speed1 = _sample(first, times_s)
    q2, speed2 = _sample(second, times_s)
    down = np.where(q1 < 0, -angle, 0.0)
    length = experiment.size_m[0][0]
    pitch1 = -angle * np.clip(0.5 - q1 / length, 0.0, 1.0)
    position = np.array(
        [[corner_m + q1 * np.cos(down), experiment.size_m[0][1] / 2 + q1 * np.sin(down)]]
    )
    velocity = np.array([[speed1 * np.cos(down), speed1 * np.sin(down)]])
    pitch = pitch1[None]
    if experiment.object2_x_m is not None:
        level = np.full_like(q2, experiment.size_m[1][1] / 2)
        position = np.concatenate([position, [[experiment.object2_x_m + q2, level]]])
        velocity = np.concatenate([velocity, [[speed2, np.zeros_like(q2)]]])
        pitch = np.concatenate([pitch, np.zeros((1, len(times_s)))])
    return Solution(np.asarray(times_s), position, velocity, pitch, _finite(foot_s), _finite(hit_s))


def _braked(start_s: float, q_m: float, speed_m_s: float, brake_m_s2: float) -> list[Piece]:
    """Returns a piece that slows down and, unless without friction, one that rests."""
    slowing = Piece(start_s, q_m, speed_m_s, -brake_m_s2)
    rest_s = slowing.rests()
    if rest_s == inf:
        return [slowing]
    return [slowing, Piece(rest_s, slowing.at(rest_s)[0], 0.0, 0.0)]


def _sample(pieces: list[Piece], times_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    starts = [piece.start_s for piece in pieces]
    current = np.searchsorted(starts, times_s, side="right") - 1
    samples = np.array([pieces[i].at(t) for i, t in zip(current, times_s, strict=True)])
    return samples[:, 0], samples[:, 1]


def _finite(time_s: float) -> float | None:
    return time_s if time_s < inf else None

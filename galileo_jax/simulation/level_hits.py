"""When pucks meet each other or a wall, and what the hit does: for clips with known truth.

No copy of the engine's `level_hits`: rims that are not round are felt for in a fan of directions,
and impulses act at points.
"""

import math
from collections.abc import Mapping, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from galileo_jax.simulation.plane import Point
from galileo_jax.simulation.solver import PLASTIC_M_S

FAN_RAD, NUM_FAN, FAN_TIMES = 0.5, 41, 5  # directions that are tried, finer each time
CLOSES_M = 1e-9  # within a step, what is about to meet


class Rims(NamedTuple):
    """Rims that may be oval, see `Effect.oval`: mean radii, and c and s as shares of them."""

    radius_m: np.ndarray
    oval: np.ndarray

    @property
    def are_round(self) -> bool:
        """Whether all are."""
        return not self.oval.any()

    def reach_m(
        self, place: np.ndarray, i: int, angles: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """How far a rim reaches in some directions from its middle, and its slope over them."""
        twice = 2 * (angles - math.sqrt(2) * place[i, 2] / self.radius_m[i])
        (c, s), radius = self.oval[i], self.radius_m[i]
        bulge = c * np.cos(twice) + s * np.sin(twice)
        return radius * (1 + bulge), 2 * radius * (s * np.cos(twice) - c * np.sin(twice))

    def touching_m(self, place: np.ndarray, i: int, angle: float) -> np.ndarray:
        """From a middle to the point of its rim that is farthest in a direction."""
        reach, slope = self.reach_m(place, i, np.array(angle))
        cos, sin = math.cos(angle), math.sin(angle)
        return np.array([reach * cos - slope * sin, reach * sin + slope * cos])

    def facing(self, place: np.ndarray, i: int, j: int) -> tuple[float, float]:
        """In which direction two rims are farthest apart, of all of a fine fan, and how far."""
        x, y = (place[j] - place[i])[:2]
        straight, fan, around = math.atan2(y, x), FAN_RAD, 0.0
        for _ in range(FAN_TIMES):
            around = around + np.linspace(-fan, fan, NUM_FAN)
            apart = math.hypot(x, y) * np.cos(around)
            for k in (i, j):
                apart = apart - self.reach_m(place, k, straight + around)[0]
            best = int(np.argmax(apart))
            around, gap, fan = around[best], float(apart[best]), 2 * fan / NUM_FAN
        return straight + float(around), gap


class Rails(NamedTuple):
    """Walls: where each begins, its direction, that to its left, and its length."""

    start_m: np.ndarray
    along: np.ndarray
    left: np.ndarray
    length: np.ndarray

    @classmethod
    def of(cls, walls_m: Sequence[tuple[Point, Point]]) -> "Rails":
        """Of walls between two ends."""
        ends = np.array(walls_m, float).reshape(-1, 2, 2)
        along = ends[:, 1] - ends[:, 0]
        length = np.linalg.norm(along, axis=1)
        along = along / length[:, None]
        return cls(ends[:, 0], along, np.stack([-along[:, 1], along[:, 0]], axis=1), length)

    def meets_s(self, place: np.ndarray, mean: np.ndarray, i: int, rims: Rims) -> np.ndarray:
        """When a puck meets each wall at constant speeds, s; inf if never."""
        at, u = place[i, :2], mean[i, :2]
        away = ((at - self.start_m) * self.left).sum(axis=1)
        side = np.where(away < 0, -1.0, 1.0)
        reach, slope = rims.reach_m(place, i, np.arctan2(*(side[:, None] * self.left).T[::-1]))
        closing = side * (self.left @ u) + slope * math.sqrt(2) * mean[i, 2] / rims.radius_m[i]
        with np.errstate(divide="ignore", invalid="ignore"):
            meets = np.maximum(np.abs(away) - reach, 0.0) / np.abs(closing)
            reached = ((at + meets[:, None] * u - self.start_m) * self.along).sum(axis=1)
        ahead = (closing < 0) & (reached >= 0) & (reached <= self.length)
        return np.where(ahead, meets, np.inf)


class Table(NamedTuple):
    """Pucks and what they meet."""

    rims: Rims
    rails: Rails
    mass_kg: np.ndarray
    values: Mapping[str, float]  # parameters by name

    def next_hit(
        self, place: np.ndarray, mean: np.ndarray, left_s: float
    ) -> tuple[float, tuple[int, int, bool] | None]:
        """When the first hit within `left_s` is, s, and what hits what: a puck, or a wall."""
        rims, rails = self.rims, self.rails
        soonest, struck = left_s, None
        for i, j in combinations(range(len(place)), 2):
            if rims.are_round:
                reach = rims.radius_m[i] + rims.radius_m[j]
                meets = _meets_s(place[j] - place[i], mean[j] - mean[i], reach)
            else:
                meets = self._ovals_meet_s(place, mean, i, j, left_s)
            if meets < soonest:
                soonest, struck = meets, (i, j, False)
        for i in range(len(place)) if len(rails.length) else ():
            meets = rails.meets_s(place, mean, i, rims)
            wall = int(np.argmin(meets))
            if meets[wall] < soonest:
                soonest, struck = float(meets[wall]), (i, wall, True)
        return soonest, struck

    def _ovals_meet_s(
        self, place: np.ndarray, mean: np.ndarray, i: int, j: int, left_s: float
    ) -> float:
        """As `_meets_s`, within `left_s`, as if the gap closed evenly."""
        rims = self.rims
        most = 2 * (rims.radius_m[i] + rims.radius_m[j])
        if np.hypot(*(place[j] - place[i])[:2]) > most:
            return math.inf
        now = rims.facing(place, i, j)[1]
        then = rims.facing(place + left_s * mean, i, j)[1]
        if then >= 0 or then >= now - CLOSES_M:
            return math.inf
        return left_s * max(now, 0.0) / (now - then)

    def strike_wall(self, place: np.ndarray, speed: np.ndarray, i: int, wall: int) -> None:
        """Changes the speed of a puck by the impulse of a wall."""
        rims, rails, values = self.rims, self.rails, self.values
        normal = rails.left[wall]
        if (place[i, :2] - rails.start_m[wall]) @ normal < 0:  # it is on the wall's other side
            normal = -normal
        point = rims.touching_m(place, i, math.atan2(-normal[1], -normal[0]))
        radius = rims.radius_m[i]
        u, gives = _at(point, speed[i], radius, 1.0)
        impulse = _impulse(u, gives, normal, values["wall_restitution"], values["wall_grip"])
        _push(speed[i], impulse, point, radius, 1.0)

    def strike(self, place: np.ndarray, speed: np.ndarray, i: int, j: int) -> None:
        """Changes the speeds by the impulses of a hit of two pucks."""
        rims, mass, values = self.rims, self.mass_kg, self.values
        if rims.are_round:
            x, y = (place[j] - place[i])[:2]
            angle = math.atan2(y, x)
        else:
            angle, _ = rims.facing(place, i, j)
        points = [rims.touching_m(place, k, a) for k, a in ((i, angle), (j, angle + math.pi))]
        ends = [
            _at(point, speed[k], rims.radius_m[k], mass[k])
            for point, k in zip(points, (i, j), strict=True)
        ]
        u, gives = ends[1][0] - ends[0][0], ends[1][1] + ends[0][1]
        normal = np.array([math.cos(angle), math.sin(angle)])
        impulse = _impulse(u, gives, normal, values["restitution"], values["grip"])
        _push(speed[i], -impulse, points[0], rims.radius_m[i], mass[i])
        _push(speed[j], impulse, points[1], rims.radius_m[j], mass[j])


def _meets_s(apart: np.ndarray, u: np.ndarray, reach: float) -> float:
    """When two pucks meet at constant speeds, s; inf if never."""
    closing = float(apart[:2] @ u[:2])
    if closing >= 0:
        return math.inf
    square, gap = float(u[:2] @ u[:2]), float(apart[:2] @ apart[:2]) - reach**2
    root2 = closing**2 - square * gap
    return max(gap, 0.0) / (math.sqrt(root2) - closing) if root2 > 0 else math.inf


def _at(
    point: np.ndarray, speed: np.ndarray, radius: float, mass: float
) -> tuple[np.ndarray, np.ndarray]:
    """The velocity of a puck's point, and by what it changes per impulse there, `[2, 2]`."""
    arm = np.array([-point[1], point[0]])
    turning = math.sqrt(2) * speed[2] / radius
    inertia = mass * radius**2 / 2
    return speed[:2] + turning * arm, np.eye(2) / mass + np.outer(arm, arm) / inertia


def _impulse(
    u: np.ndarray, gives: np.ndarray, normal: np.ndarray, restitution: float, grip: float
) -> np.ndarray:
    """Newton's along the normal, and across it Coulomb's or what stops the slip."""
    across = np.array([-normal[1], normal[0]])
    approach = float(-u @ normal)
    e = restitution if approach > PLASTIC_M_S else 0.0
    axes = np.stack([normal, across], axis=1)
    wanted = np.array([(1 + e) * approach, float(-u @ across)])
    turned = axes.T @ gives @ axes
    push, rub = np.linalg.solve(turned, wanted)
    if abs(rub) > grip * push:
        way = math.copysign(grip, rub)
        push = wanted[0] / (turned[0, 0] + way * turned[0, 1])
        rub = way * push
    return push * normal + rub * across


def _push(
    speed: np.ndarray, impulse: np.ndarray, point: np.ndarray, radius: float, mass: float
) -> None:
    """Gives a puck an impulse at one of its points."""
    speed[:2] += impulse / mass
    torque = point[0] * impulse[1] - point[1] * impulse[0]
    speed[2] += math.sqrt(2) * torque / (mass * radius)

"""The speed of what moves already when it is first seen: whoever let it go did so before.

The first half of the way (of the way back, where it first goes the other way: up a slope, say) is
described in two ways with as many numbers each,

    let go in the clip:    s = s0 + a u^2 / 2 + b u^3 + c u^4,    u = max(t - t_r, 0),    t_r >= 0
    moving at first:       s = s0 + v0 t + a t^2 / 2 + b t^3 + c t^4,                     v0 > a dt

with t from the first place seen, b and c for what a drag does, and dt the time between two places:
what was let go less than that before is let go in the first frame. It moves where v0 is larger, and
the second likelier, by `CLEAR` standard deviations of errors as large as those that it leaves.
"""

import math
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from scipy.optimize import OptimizeResult, minimize_scalar

from galileo_jax.numerics.least_squares import LinearFit, least_squares
from galileo_jax.observation.observation import Observation

EARLY = 0.5  # of the way
FEWEST, TERMS = 9, 5  # places, and numbers that describe them
TERMS_OF_FEW = 3  # without b and c
NEAR_FOOT = 0.25  # of the way down a ramp to its table
PLAIN = 4.0  # of the variance of the errors: what they leave where they are twice those stated
CLEAR = 5.0  # standard deviations
SURE = 3.0  # the same, where it is clear that it is not let go at once
RELEASES = 48  # instants between which the best is looked for


class StartSpeed(NamedTuple):
    """A speed along the way, negative against it, and its standard deviation, m/s."""

    mean_m_s: float
    sd_m_s: float


def start_speed(observation: Observation) -> StartSpeed | None:
    """How fast object 1 moves where it is first seen; None where it is let go later, or at once.

    Of so short a part that what acts later on the way does not bend the description.
    """
    early = _first_half(observation)
    if early is None:
        return None
    fit = early.moving()
    while len(early.times_s) > 2 * FEWEST and np.sum(fit.left**2) > PLAIN * len(early.times_s):
        early = early.first(len(early.times_s) // 2)
        fit = early.moving()
    moving, moves_cost = fit.solution, float(np.sum(fit.left**2))
    size = early.scatter(moves_cost)
    sd_m_s = math.sqrt(size * fit.inverse[1, 1])
    in_a_step = max(2 * float(moving[2]), 0.0) * float(np.median(np.diff(early.times_s)))
    if moving[1] - CLEAR * sd_m_s < in_a_step:
        return None
    better = early.let_go()[0] - moves_cost
    return StartSpeed(early.sign * moving[1], sd_m_s) if better > CLEAR**2 * size else None


def may_move(observation: Observation) -> bool:
    """Whether a start in motion is likelier than being let go in the clip; not if nobody knows.

    What would start backwards is let go later, and what first goes the other way is in a hand.
    """
    early = _first_half(observation, fewest=TERMS_OF_FEW + 2)
    if early is None or early.sign < 0:
        return False
    fit = early.moving()
    return fit.solution[1] > 0 and early.let_go()[0] > float(np.sum(fit.left**2))


def rest_s(observation: Observation) -> float | None:
    """How long object 1 rests where it is first seen, s; None where it does not (`_Way.rest`)."""
    early = _first_half(observation)
    rest = None if early is None else early.rest()
    return None if rest is None else rest[1]


def let_go_frame(observation: Observation) -> int | None:
    """The first frame in which a swing moves by itself; None where it is not held at first.

    Where its rest is over for certain: a frame too many tells a speed that is not there. What sinks
    in a liquid is let go so, too.
    """
    early = _first_half(observation)
    if early is None or (rest := early.rest()) is None:
        return None
    cost, rests_s = rest
    most = cost + SURE**2 * early.scatter(cost)
    later = range(int(np.searchsorted(early.times_s, rests_s)), len(early.times_s))
    at = next((i for i in later if early.release_cost(float(early.times_s[i])) > most), None)
    return None if at is None else int(np.flatnonzero(observation.mask[0])[at])


def on_ramp(observation: Observation) -> Observation:
    """The observation with object 1 on the ramp alone, above where its front meets the table."""
    mask, x_m = observation.mask.copy(), observation.position_m[0, 0]
    first = int(np.argmax(mask[0]))
    mask[0] &= x_m < NEAR_FOOT * min(float(x_m[first]), 0.0)
    return replace(observation, mask=mask)


class _Way(NamedTuple):
    """The first half of a way: times from the first place seen, s, `[place]`, metres, and sds."""

    times_s: np.ndarray
    way_m: np.ndarray
    sd_m: np.ndarray
    sign: float  # -1: it first goes against the way of all

    def first(self, count: int) -> "_Way":
        """Its first places."""
        return _Way(self.times_s[:count], self.way_m[:count], self.sd_m[:count], self.sign)

    @property
    def terms(self) -> int:
        """How many numbers describe it."""
        return TERMS if len(self.times_s) >= FEWEST else TERMS_OF_FEW

    def fit(self, design: np.ndarray) -> LinearFit:
        """What a design makes of it, in units of the sds."""
        return least_squares(design / self.sd_m[:, None], self.way_m / self.sd_m)

    def scatter(self, cost: float) -> float:
        """The variance of errors over the stated one, at least 1."""
        return max(1.0, cost / max(len(self.times_s) - self.terms, 1))

    def moving(self) -> LinearFit:
        """What a start in motion makes of it."""
        return self.fit(np.vander(self.times_s, self.terms, increasing=True))

    def release_cost(self, release_s: float) -> float:
        """The least sum of squared errors of a release from rest at an instant."""
        powers = np.vander(np.maximum(self.times_s - release_s, 0.0), self.terms, increasing=True)
        return float(np.sum(self.fit(np.delete(powers, 1, axis=1)).left ** 2))

    def let_go(self) -> tuple[float, float]:
        """The least of these in the clip, and its instant, s."""
        grid = np.linspace(self.times_s[0], self.times_s[-1], RELEASES)
        costs = [self.release_cost(release_s) for release_s in grid]
        at = int(np.argmin(costs))
        bounds = float(grid[max(at - 1, 0)]), float(grid[min(at + 1, RELEASES - 1)])
        found = minimize_scalar(self.release_cost, bounds=bounds, method="bounded")
        between = cast(OptimizeResult, found)
        return min((costs[at], float(grid[at])), (float(between.fun), float(between.x)))

    def rest(self) -> tuple[float, float] | None:
        """The same where it rests before; None where it is let go at once, or moves.

        It rests if a release that late is likelier than one in the first frame, by `CLEAR` standard
        deviations, and than a start in motion, by `SURE`.
        """
        cost, release_s = self.let_go()
        size = self.scatter(cost)
        is_later = release_s > 1.5 * float(np.median(np.diff(self.times_s)))
        is_later &= self.release_cost(0.0) - cost > CLEAR**2 * size
        moving_cost = float(np.sum(self.moving().left ** 2))
        return (cost, release_s) if is_later and moving_cost - cost > SURE**2 * size else None


def _first_half(observation: Observation, fewest: int = FEWEST) -> _Way | None:
    """Of object 1; None where it is seen in fewer places."""
    path = observation.path()
    seen, gone = path.frames, path.gone_m
    distance = np.linalg.norm(gone, axis=0)
    if len(seen) < fewest or not distance.max() > 0:
        return None
    farthest = int(np.argmax(distance))
    along = gone[:, farthest] / distance[farthest]
    covariance = observation.covariance_m2[0][..., seen]
    lasting = np.einsum("i,mit->mt", along, observation.lasting_m[:, 0][..., seen])
    # Of a picture that a coder froze each frame's own error is next to nothing.
    own = np.einsum("i,ijt,j->t", along, covariance, along)
    sd = np.sqrt(own + np.sum(lasting**2, axis=0))
    way = along @ gone
    back = int(np.argmin(way[: farthest + 1]))
    sign = -1.0 if way[back] < -CLEAR * math.hypot(sd[0], sd[back]) else 1.0
    way, end = sign * way, back if sign < 0 else farthest
    early = slice(0, max(FEWEST, int(np.argmax(way > EARLY * way[end]))))
    times = path.times_s - path.times_s[0]
    return _Way(times[early], way[early], sd[early], sign)

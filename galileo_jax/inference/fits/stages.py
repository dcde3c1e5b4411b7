"""Trials as seen before a hit: what one phase of the motion tells, without side valleys.

When a hit comes depends on all that happened before, and which frames compare with which depends on
when it comes. Before it only the friction of what moves counts, and a search cannot miss it; what
that leaves open is searched for next. So growing spans of time fit parameters of differential
equations that no start is near enough to (C. Michalik, R. Hannemann, W. Marquardt, Incremental
single shooting, preprint AICES-2009-8, RWTH Aachen, 2009).
"""

from dataclasses import replace

import numpy as np

from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem

MOVED_SD, MOVED_M = 6.0, 3e-4  # an object farther than both from where it stood has moved
STANDING_FRAMES = 5  # that say where it stood
LEAST_FRAMES = 4  # before it moves: from fewer nothing is fitted


def before_moving(trials: JointProblem, index: int) -> JointProblem | None:
    """The trials as they were seen before an object moves; None where one of them hardly was.

    Args:
      trials: of any number of clips.
      index: of the object, along the travel.
    """
    short = [_before_moving(problem, index) for problem in trials.problems]
    found = [problem for problem in short if problem is not None]
    return JointProblem(tuple(found)) if len(found) == len(short) else None


def _before_moving(problem: Problem, index: int) -> Problem | None:
    seen = problem.observation
    mask, position = seen.mask[index], seen.position_m[index]
    there = np.flatnonzero(mask)
    if there.size < LEAST_FRAMES:
        return None
    stood = np.median(position[:, there[:STANDING_FRAMES]], axis=1, keepdims=True)
    variance = np.trace(seen.covariance_m2[index])[there] / 2
    moved_m = np.maximum(MOVED_SD * np.sqrt(variance), MOVED_M)
    is_away = np.linalg.norm((position - stood)[:, there], axis=0) > moved_m
    # Sure only of two frames in a row: one may be an outlier.
    away = there[:-1][is_away[:-1] & is_away[1:]]
    # It has been on its way for less than a frame when that is first seen.
    first = int(away[0]) - 1 if away.size else len(seen.times_s)
    if first < LEAST_FRAMES:
        return None
    before = np.arange(len(seen.times_s)) < first
    return replace(problem, observation=replace(seen, mask=seen.mask & before))

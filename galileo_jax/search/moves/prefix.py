"""Starts that suit what was seen before each further object moved, or a bounce.

When a hit comes depends on all that happened before, and which frames compare with which depends on
when it comes. Before it only the friction of what moves counts, and a search cannot miss it; what
that leaves open is searched for next. So growing spans of time fit parameters of differential
equations that no start is near enough to (C. Michalik, R. Hannemann, W. Marquardt, Incremental
single shooting, preprint AICES-2009-8, RWTH Aachen, 2009).
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations, product

import numpy as np

from galileo_jax.inference.fits.descent import ends_of, valleys
from galileo_jax.inference.fits.gradient import GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.problem import Problem
from galileo_jax.model.effects.laws.pucks import START
from galileo_jax.numerics.line_segments import nearest_frames
from galileo_jax.numerics.normal_matrix import inverse
from galileo_jax.search.starts import absent_z, scattered_round
from galileo_jax.search.table import Start, Table

NAME = "prefix"
NUM_STARTS, NUM_FOLLOWED = 128, 8
NUM_OF_PHASE, NUM_OF_PHASE_FOLLOWED = 64, 4
OPEN_SD_Z = 0.5  # of the prior's 1: what a phase leaves so open is scattered in the next one
MOST_BOUNCES = 4  # off walls, before which a search stops on its way
LEAST_FRAMES = 4  # before it moves: from fewer nothing is fitted


def propose(table: Table) -> list[Start]:
    """Starts of a fit without rivals that is in doubt; once, for they are of no other fit."""
    if not table.is_in_doubt or table.has_asked(NAME):
        return []
    return [
        Start((), z, table.base, NAME, number % NUM_FOLLOWED)
        for number, z in enumerate(by_phases(table))
    ]


def by_phases(table: Table) -> np.ndarray:
    """Starts in which each phase knows what those before it told, `[start, z]`."""
    trials, seed, free = table.trials, table.seed, table.free([()])[0]
    is_main = free & np.array([p.role != "nuisance" for p in trials.model_parameters])
    centres, is_open = absent_z(trials)[None], is_main[None]
    for short in phases(trials):
        fitter = GradientFitter(short)
        starts = scattered_round(short, centres, is_open, NUM_OF_PHASE, seed)
        every = np.tile(free, (len(starts), 1))
        best = np.argsort(fitter.search_costs(starts, every))[:NUM_OF_PHASE_FOLLOWED]
        found = fitter.race(starts[best], every[best], np.zeros(len(best), int))
        rows = valleys(found.best, np.unique(ends_of(found.joined)))
        variance = np.diagonal(inverse(found.best.normal[rows]), axis1=1, axis2=2)
        centres, is_open = found.best.z[rows], is_main & (variance > OPEN_SD_Z**2)
        table.fitter.residuals.num_rollouts += fitter.residuals.num_rollouts
    return scattered_round(trials, centres, is_open, NUM_STARTS, seed)


def phases(trials: JointProblem) -> Iterator[JointProblem]:
    """The trials as they were seen before each further object moved, then before each bounce.

    Spans that grow; of bounces off walls the first few of all clips. Pucks that all move at first
    are seen until two of them are nearest to each other.
    """
    meetings = [_meeting(problem) for problem in trials.problems]
    if min(meetings) >= LEAST_FRAMES:
        yield JointProblem(tuple(map(_until, trials.problems, meetings)))
    for index in range(1, len(trials.problems[0].observation.names)):
        if (short := before_moving(trials, index)) is not None:
            yield short
    frames = [_bounces(problem) for problem in trials.problems]
    for k in range(min(MOST_BOUNCES, max(map(len, frames)))):
        yield JointProblem(
            tuple(
                _until(problem, own[k]) if k < len(own) else problem
                for problem, own in zip(trials.problems, frames, strict=True)
            )
        )


def _meeting(problem: Problem) -> int:
    """The frame in which two pucks are nearest to each other, all of which move; 0: none."""
    seen, scene = problem.observation, problem.model.scene.surroundings
    moves = [f"{START[0]}{i + 1}" in scene.expected for i in range(len(seen.names))]
    if not scene.is_level or len(moves) < 2 or not all(moves):
        return 0
    nearest = []
    for i, j in combinations(range(len(moves)), 2):
        apart = np.linalg.norm(seen.position_m[i, :2] - seen.position_m[j, :2], axis=0)
        both = seen.mask[i] & seen.mask[j]
        nearest.append(int(np.argmin(np.where(both, apart, np.inf))))
    return min(nearest)


def _bounces(problem: Problem) -> list[int]:
    """Frames in which discs are nearest to a wall, in order, without the first few."""
    seen, scene = problem.observation, problem.model.scene.surroundings
    found = set()
    for i, ends in product(range(len(seen.names)), scene.walls_m):
        found |= {
            *nearest_frames(seen.position_m[i, :2], seen.mask[i], ends, scene.half_length_m[i])
        }
    return sorted(frame for frame in found if frame >= LEAST_FRAMES)


def _until(problem: Problem, end: int) -> Problem:
    before = np.arange(len(problem.observation.times_s)) < end
    seen = problem.observation
    return replace(problem, observation=replace(seen, mask=seen.mask & before))


def before_moving(trials: JointProblem, index: int) -> JointProblem | None:
    """The trials as they were seen before an object moves; None where one of them hardly was.

    `index`: of the object, along the travel.
    """
    ends = [_moving(problem, index) for problem in trials.problems]
    if min(ends) < LEAST_FRAMES:
        return None
    return JointProblem(tuple(map(_until, trials.problems, ends)))


def _moving(problem: Problem, index: int) -> int:
    """The frame in which an object begins to move; 0 where it was hardly seen."""
    seen = problem.observation
    if seen.mask[index].sum() < LEAST_FRAMES:
        return 0
    away = seen.first_away(index)
    # It has been on its way for less than a frame when that is first seen.
    return len(seen.times_s) if away is None else away - 1

"""Phases are those of the motion, event by event."""

from dataclasses import replace

import numpy as np

from galileo_jax.comparison.phases import COLLISION_S, PHASES, phases
from galileo_jax.model.effects.registry import make_effects
from tests.oracle_trials import make_trials
from tests.ramp_model import HIT, make_theta
from tests.reference_ramp import Experiment, solve


def label(experiment: Experiment, effects=(), **given: float):
    """Times, the closed form's solution and each object's phases by name."""
    (problem,) = make_trials([experiment], effects=make_effects(effects)).problems
    theta = make_theta(problem.model, experiment, {"foot_transition": 1.0, **given})
    times = problem.observation.times_s
    return times, solve(experiment, times), np.array(PHASES)[phases(problem, theta)]


def test_every_phase_is_where_it_happens():
    times, exact, found = label(HIT)
    assert exact.hit_s is not None and exact.foot_s is not None
    first, second = found
    assert first[0] == "held"
    half = HIT.size_m[0][0] / 2
    beyond = exact.position_m[0, 0] - HIT.size_m[0][1] / 2 * np.tan(HIT.angle_rad / 2)
    moving = (times > 0) & (times < exact.hit_s - COLLISION_S)
    moving &= np.hypot(*exact.velocity_m_s[0]) > 0.05
    assert set(first[moving & (beyond < -half - 0.01)]) == {"ramp"}
    assert set(first[moving & (np.abs(beyond) < half - 0.01)]) == {"foot"}
    assert set(first[moving & (beyond > half + 0.01)]) == {"table"}
    near = np.abs(times - exact.hit_s) < COLLISION_S - 0.01
    for one in found:
        assert set(one[near]) == {"collision"}
        assert set(one[times > exact.hit_s + COLLISION_S + 0.01]) == {"after"}
    assert set(second[1:][moving[1:]]) == {"at rest"}


def test_without_a_hit_there_is_none():
    stops = replace(HIT, friction=(0.34, 0.2))
    times, exact, found = label(stops)
    assert exact.hit_s is None
    assert not {"collision", "after"} & set(found.ravel())
    speed = np.hypot(*exact.velocity_m_s[0])
    stopped = (times > 0.2) & (speed == 0)
    assert set(found[0][stopped]) <= {"at rest"}
    assert set(found[1][1:]) == {"at rest"}


def test_what_never_starts_rests():
    _, _, found = label(replace(HIT, friction=(0.5, 0.2)))
    assert set(found[:, 1:].ravel()) == {"at rest"}


def test_a_late_start_is_held():
    """Until the delayed release, by the effect's own clock."""
    times, _, found = label(HIT, ("release_delay",), release_delay=0.25)
    assert set(found[0][times < 0.24]) == {"held"}
    assert "held" not in set(found[0][times > 0.26])

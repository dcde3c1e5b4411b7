"""The oracle itself is checked by conservation laws and a brute-force integration."""

from dataclasses import replace
from math import cos, radians, sin, tan

import numpy as np
import pytest

from tests.reference_ramp import Experiment, solve

SIZES = ((0.06, 0.05), (0.07, 0.06))
CASES = {
    "pushes on": ((0.5, 0.3), (0.1, 0.2), 20),
    "parts": ((0.3, 0.6), (0.25, 0.1), 20),
    "flat": ((0.4, 0.4), (0.05, 0.3), 10),
    "stops before": ((0.4, 0.4), (0.31, 0.3), 20),
    "never moves": ((0.4, 0.4), (0.2, 0.3), 10),
    "frictionless": ((0.4, 0.2), (0.0, 0.0), 15),
}


def experiment(case: str) -> Experiment:
    mass, friction, angle_deg = CASES[case]
    return Experiment(mass, friction, radians(angle_deg), SIZES, 0.5, 0.25)


def brute_force(given: Experiment, end_s: float, step_s: float = 2e-5):
    """The same laws in small time steps; returns path coordinates and speeds at the end."""
    k1, k2 = given.friction
    m1, m2 = given.mass_kg
    corner = SIZES[0][1] / 2 * tan(given.angle_rad / 2)
    assert given.object2_x_m is not None
    hit_q = given.object2_x_m - (SIZES[0][0] + SIZES[1][0]) / 2 - corner
    q, v = np.array([corner - given.release_m, hit_q]), np.zeros(2)
    for _ in range(round(end_s / step_s)):
        on_ramp = q[0] < 0
        pull = given.gravity * sin(given.angle_rad) if on_ramp else 0.0
        grip = k1 * given.gravity * (cos(given.angle_rad) if on_ramp else 1.0)
        v[0] = max(0.0, v[0] + (pull - grip) * step_s)
        v[1] = max(0.0, v[1] - k2 * given.gravity * step_s)
        q = q + v * step_s
        if on_ramp and q[0] >= 0:
            v[0] *= cos(given.angle_rad) - k1 * sin(given.angle_rad)
        if q[0] >= q[1] and v[0] > v[1]:
            v[:] = (m1 * v[0] + m2 * v[1]) / (m1 + m2)
    return q - [0, hit_q], v


@pytest.mark.parametrize("case", CASES)
def test_agrees_with_small_steps(case):
    given = experiment(case)
    end_s = 1.7
    motion = solve(given, np.array([end_s]))
    q, v = brute_force(given, end_s)
    corner = SIZES[0][1] / 2 * tan(given.angle_rad / 2)
    x = corner + q[0] * (cos(given.angle_rad) if q[0] < 0 else 1.0)
    assert motion.position_m[0, 0, 0] == pytest.approx(x, abs=2e-4)
    assert motion.position_m[1, 0, 0] == pytest.approx(0.25 + q[1], abs=2e-4)
    assert np.hypot(*motion.velocity_m_s[:, :, 0].T) == pytest.approx(v, abs=5e-4)


def test_momentum_is_kept_and_the_impact_is_plastic():
    given = experiment("pushes on")
    hit_s = solve(given, np.zeros(1)).hit_s
    assert hit_s is not None
    before, after = solve(given, np.array([hit_s - 1e-9, hit_s + 1e-9])).velocity_m_s[:, 0].T
    mass = np.array(given.mass_kg)
    assert mass @ after == pytest.approx(mass @ before, abs=1e-7)
    assert after[0] == pytest.approx(after[1], abs=1e-7)


def test_path_is_continuous_and_parallel_to_ramp_and_table():
    given = experiment("pushes on")
    times = np.linspace(0, 2, 20001)
    motion = solve(given, times)
    assert np.abs(np.diff(motion.position_m, axis=-1)).max() < 2e-4
    x, y = motion.position_m[0]
    half_height = SIZES[0][1] / 2
    above_ramp = x * sin(given.angle_rad) + y * cos(given.angle_rad)
    assert np.minimum(y, above_ramp) == pytest.approx(half_height, abs=1e-12)
    distance = solve(given, np.zeros(1)).position_m[0, :, 0]
    assert np.array([-cos(given.angle_rad), sin(given.angle_rad)]) @ distance == pytest.approx(0.5)


def test_boxes_never_overlap():
    times = np.linspace(0, 3, 3001)
    for case in CASES:
        x = solve(experiment(case), times).position_m[:, 0]
        assert (x[1] - x[0]).min() >= (SIZES[0][0] + SIZES[1][0]) / 2 - 1e-12


def test_object_2_on_the_foot_is_refused():
    given = experiment("parts")
    with pytest.raises(ValueError, match="on the foot"):
        solve(replace(given, object2_x_m=0.065), np.zeros(1))
